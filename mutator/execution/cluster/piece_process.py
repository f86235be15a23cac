"""The process on a worker that runs pieces of work.

`python -m mutator.execution.cluster.piece_process FD FILE FOLDER NAME` reads the run's inputs from the open
file FILE. Over the connection FD, it receives pieces from its host, and sends the id of each finished
experiment, then the result of the piece. Because the process is separate from the host, no run can kill the
worker.
"""

import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

from mutator._common.confined_files import path_below
from mutator._common.files import raising_disk_full
from mutator._common.hashing import canonical_json
from mutator.campaigns.run_inputs import RunInputs
from mutator.campaigns.shared_runs import group_by_run
from mutator.engines import sandbox
from mutator.engines.engine_jobs import MODES_TO_PROVE, EngineArguments, Job
from mutator.engines.reference_engine import ReferenceEngine
from mutator.errors import DiskFull, ResourceShortage, WorkerGoldenRunsDiffer
from mutator.execution.cluster.golden_cache import GoldenRunCache
from mutator.execution.cluster.piece_messages import Piece, PieceEnding, PieceKind, PieceResult
from mutator.execution.cluster.unpacked_bundle import UnpackedBundle
from mutator.execution.experiment_runner import RecordedExperiment
from mutator.execution.worker import timing_of
from mutator.execution.worker_problems import describe_problem, reported_error
from mutator.execution.worker_processes import opened_by_parent
from mutator.execution.worker_runners import WorkerRunners
from mutator.model import Experiment
from mutator.preflight.check_run_problems import read_check_run
from mutator.store.checksummed_blocks import block_bytes
from mutator.store.golden_runs import GoldenRun
from mutator.store.packed_patches import pack_patches
from mutator.store.records import record_as_json
from mutator.store.series_packing import series_block
from mutator.targets.required_packages import check_requirements


class PieceRunner:
    """Runs pieces in an unpacked bundle, and packs the results."""

    def __init__(self, bundle: UnpackedBundle, inputs: RunInputs, worker_name: str, parent_pid: int) -> None:
        self._bundle, self._worker_name, self._parent_pid = bundle, worker_name, parent_pid
        self._manifest, self._models = inputs.manifest, inputs.fault_models
        check_requirements(inputs.manifest)
        if inputs.manifest.sandbox:
            sandbox.check_sandbox_available()
        self.folder = bundle.folder
        self._work_folder = bundle.folder / f"work-{os.getpid()}"
        self._work_folder.mkdir()
        self._goldens_folder = self._work_folder / "golden"
        self._golden_cache = GoldenRunCache(bundle, inputs.manifest)
        self._digest_by_golden: dict[str, str] = {}  # by key
        self._note_golden_digests()
        self._matching_goldens: set[str] = set()  # golden runs that equal the campaign's
        self._runners: WorkerRunners | None = None  # made for the first piece

    def run_piece(self, piece: Piece, report_finished: Callable[[str], None]) -> PieceResult:
        """Run a piece. Calls `report_finished` with the id of each finished experiment.

        Raises WorkerGoldenRunsDiffer if a golden run made here differs from the campaign's.
        """
        began = time.monotonic()
        experiments = piece.parse_experiments()
        # a shared run is compared with the golden run of its first experiment
        for same in group_by_run(self._manifest, experiments):
            if (key := self._golden_of(same[0]).key) not in self._matching_goldens:
                self._ensure_golden(key)
        runners, is_proof = self._ensure_runners(), piece.kind is PieceKind.PROVE
        finished: list[RecordedExperiment] = []
        for ended in runners.prove(experiments) if is_proof else runners.run(experiments):
            finished.append(ended)
            report_finished(ended.experiment.id)
        result = _build_result(finished, self._worker_name, is_proof=is_proof)
        return replace(result, number=piece.number, seconds=time.monotonic() - began)

    def close(self) -> None:
        if self._runners is not None:
            self._runners.close()

    def _ensure_runners(self) -> WorkerRunners:
        self._runners = self._runners or self._make_runners()
        return self._runners

    def _note_golden_digests(self) -> None:
        self._digest_by_golden |= {
            key: golden_digest for key, (_, golden_digest) in self._bundle.golden_and_digest_by_key.items()
        }

    def _make_runners(self) -> WorkerRunners:
        bundle = self._bundle
        return WorkerRunners(
            EngineArguments(
                manifest=self._manifest,
                models=self._models,
                work_folder=self._work_folder,
                limits=bundle.limits,
                parent_pid=self._parent_pid,
            ),
            bundle.meta["engine"],
            golden_folder_of=lambda experiment: path_below(
                self._goldens_folder, self._golden_of(experiment).key
            ),
            digest_by_golden=self._digest_by_golden,
            has_seeded_goldens=bundle.meta["several_seeds"],
            scenario_file=bundle.scenario_path,
            with_series=bundle.meta["series"],
            golden_hazard_rules=bundle.golden_hazard_rules,
        )

    def _ensure_golden(self, key: str) -> None:
        """Make a golden run or copy it from the cache; WorkerGoldenRunsDiffer if it differs from the
        campaign's.
        """
        if key not in self._bundle.golden_and_digest_by_key:
            self._bundle = UnpackedBundle(self._bundle.folder)  # a bench has needed it since
            self._note_golden_digests()
        golden, expected_digest = self._bundle.golden_and_digest_by_key[key]
        folder = path_below(self._goldens_folder, key)
        self._goldens_folder.mkdir(exist_ok=True)
        if not self._golden_cache.copy_golden(golden, expected_digest, folder):
            self._make_golden(golden, expected_digest, folder)
            self._golden_cache.store_golden(golden, folder)
        self._matching_goldens.add(key)

    def _make_golden(self, golden: GoldenRun, expected_digest: str, destination: Path) -> None:
        bundle = self._bundle
        engine = ReferenceEngine(self._manifest, self._work_folder, bundle.limits, self._parent_pid)
        job = Job(
            name=f"golden-{len(self._matching_goldens)}",
            scenario=bundle.scenario_path(golden.scenario),
            seed=bundle.meta["seed"] if golden.seed is None else golden.seed,
            scenario_changes=golden.changes,
        )
        for _, execution in engine.run([job]):
            examined = read_check_run(self._manifest, execution)
            if examined.problem or examined.output_digest != expected_digest:
                problem = (
                    examined.problem
                    or f"has the digest {examined.output_digest[:16]} here, not {expected_digest[:16]}"
                )
                raise WorkerGoldenRunsDiffer(f"golden run {golden.key} {problem}")
            execution.out.rename(destination)

    def _golden_of(self, experiment: Experiment) -> GoldenRun:
        return GoldenRun.for_experiment(experiment, several_seeds=self._bundle.meta["several_seeds"])


def _build_result(finished: list[RecordedExperiment], worker_name: str, *, is_proof: bool) -> PieceResult:
    records = tuple(canonical_json(record_as_json(ended.record)).encode() for ended in finished)
    if is_proof:
        return PieceResult(number=0, ending=PieceEnding.FINISHED, records=records)
    patches = [
        (ended.experiment.id, ended.mutant.patch_bytes) for ended in finished if ended.mutant is not None
    ]
    series = [(ended.experiment.id, ended.series) for ended in finished if ended.series is not None]
    return PieceResult(
        number=0,
        ending=PieceEnding.FINISHED,
        needs_proof=any(ended.mode in MODES_TO_PROVE for ended in finished),
        records=records,
        timings=tuple(canonical_json(timing_of(ended, worker_name)).encode() for ended in finished),
        patches=pack_patches(patches),
        series=b"".join(block_bytes(*series_block(experiment, ended)) for experiment, ended in series),
        series_goldens=tuple(sorted({ended.golden_key for _, ended in series})),
    )


def _run_catching_errors(
    runner: PieceRunner, piece: Piece, report_finished: Callable[[str], None]
) -> PieceResult:
    try:
        with raising_disk_full(runner.folder):
            return runner.run_piece(piece, report_finished)
    except WorkerGoldenRunsDiffer as err:
        return PieceResult(number=piece.number, ending=PieceEnding.GOLDEN_DIFFERS, reason=str(err))
    except Exception as err:
        lacks_resources = isinstance(reported_error(err), DiskFull | ResourceShortage)
        return PieceResult(
            number=piece.number,
            ending=PieceEnding.WORKER_UNFIT if lacks_resources else PieceEnding.HARNESS_FAILED,
            reason=describe_problem(err),
        )


def _serve_pieces(connection: Connection, runner: PieceRunner) -> None:
    try:
        with suppress(EOFError):
            while True:
                piece = Piece.from_bytes(connection.recv_bytes())
                connection.send(_run_catching_errors(runner, piece, connection.send).to_bytes())
    finally:
        runner.close()


def _refuse_first_piece(connection: Connection, err: Exception) -> None:
    """Answer the first piece with the reason why this process cannot run anything."""
    with suppress(EOFError):
        piece = Piece.from_bytes(connection.recv_bytes())
        text = str(reported_error(err) or repr(err))
        connection.send(
            PieceResult(number=piece.number, ending=PieceEnding.WORKER_UNFIT, reason=text).to_bytes()
        )


def main() -> int:
    (connection, data), bundle, name = (
        opened_by_parent(sys.argv[1:]),
        UnpackedBundle(Path(sys.argv[3])),
        sys.argv[4],
    )
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the host handles these signals
    try:
        with raising_disk_full(bundle.folder):
            runner = PieceRunner(bundle, RunInputs.from_bytes(data), name, os.getppid())
    except Exception as err:
        _refuse_first_piece(connection, err)
        return 1
    _serve_pieces(connection, runner)
    return 0


if __name__ == "__main__":
    sys.exit(main())
