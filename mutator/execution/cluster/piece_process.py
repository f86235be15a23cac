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
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

from mutator._common import cache_layout_and_pruning
from mutator._common.confined_files import path_below
from mutator._common.files import raising_disk_full
from mutator._common.hashing import canonical_json
from mutator._common.resource_shortages import find_shortage
from mutator.campaigns.run_inputs import RunInputs
from mutator.campaigns.shared_runs import group_by_run
from mutator.engines import sandbox
from mutator.engines.engine_choice import make_engine
from mutator.engines.engine_jobs import MODES_TO_PROVE, EngineArguments, Job
from mutator.engines.reference_engine import ReferenceEngine
from mutator.errors import DiskFull, MutatorError, ResourceShortage, WorkerGoldenRunsDiffer
from mutator.execution.cluster.golden_cache import GoldenRunCache
from mutator.execution.cluster.piece_messages import Piece, PieceEnding, PieceKind, PieceResult
from mutator.execution.cluster.unpacked_bundle import UnpackedBundle
from mutator.execution.experiment_runner import ExperimentRunner, RecordedExperiment
from mutator.execution.inactivity_check import InactivityCheck
from mutator.execution.loaded_goldens import LoadedGoldens
from mutator.execution.worker import timing_of
from mutator.model import Experiment
from mutator.preflight.check_run_problems import read_check_run
from mutator.store.checksummed_blocks import block_bytes
from mutator.store.packed_patches import pack_patches
from mutator.store.records import record_as_json
from mutator.store.run_folder import GoldenRun
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
        self._matching_goldens: set[str] = set()  # golden runs that equal the campaign's
        self._runners_by_kind: dict[PieceKind, ExperimentRunner] = {}

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
        runner = self._runner_of_kind(piece.kind)
        finished: list[RecordedExperiment] = []
        for ended in runner.run(experiments):
            finished.append(ended)
            report_finished(ended.experiment.id)
        result = _build_result(finished, self._worker_name, is_proof=piece.kind is PieceKind.PROVE)
        return replace(result, number=piece.number, seconds=time.monotonic() - began)

    def close(self) -> None:
        for runner in self._runners_by_kind.values():
            runner.close()

    def _runner_of_kind(self, kind: PieceKind) -> ExperimentRunner:
        if kind not in self._runners_by_kind:
            bundle = self._bundle
            arguments = EngineArguments(
                manifest=self._manifest,
                models=self._models,
                work_folder=self._work_folder,
                limits=bundle.limits,
                parent_pid=self._parent_pid,
            )
            if kind is PieceKind.PROVE:
                engine = ReferenceEngine(
                    self._manifest, self._work_folder, bundle.limits, self._parent_pid, independent=True
                )
            else:
                engine = make_engine(bundle.meta["engine"], arguments)  # type: ignore[assignment]
            goldens = LoadedGoldens(
                self._manifest,
                lambda experiment: path_below(self._goldens_folder, self._golden_of(experiment).key),
                several_seeds=bundle.meta["several_seeds"],
                digests={
                    path_below(self._goldens_folder, key): golden_digest
                    for key, (_, golden_digest) in bundle.golden_and_digest_by_key.items()
                },
            )
            with_series = kind is PieceKind.RUN and bundle.meta["series"]
            self._runners_by_kind[kind] = ExperimentRunner(
                self._manifest,
                self._models,
                engine,
                goldens,
                bundle.scenario_path,
                with_series=with_series,
                inactivity_check=InactivityCheck(arguments),
            )
        return self._runners_by_kind[kind]

    def _ensure_golden(self, key: str) -> None:
        """Make a golden run or copy it from the cache; WorkerGoldenRunsDiffer if it differs from the
        campaign's.
        """
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
            if golden.seed is not None:  # the images of a hundred seeds would fill the disk
                cache_layout_and_pruning.prune_target_cache(self._manifest.cache_name)

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
        reported_error = err if isinstance(err, MutatorError) else find_shortage(err)
        lacks_resources = isinstance(reported_error, DiskFull | ResourceShortage)
        text = str(reported_error) if reported_error else "".join(traceback.format_exception(err)).rstrip()
        return PieceResult(
            number=piece.number,
            ending=PieceEnding.WORKER_UNFIT if lacks_resources else PieceEnding.HARNESS_FAILED,
            reason=text,
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
        text = str(err if isinstance(err, MutatorError) else find_shortage(err) or repr(err))
        connection.send(
            PieceResult(number=piece.number, ending=PieceEnding.WORKER_UNFIT, reason=text).to_bytes()
        )


def main() -> int:
    connection, bundle, name = Connection(int(sys.argv[1])), UnpackedBundle(Path(sys.argv[3])), sys.argv[4]
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the host handles these signals
    try:
        with raising_disk_full(bundle.folder):
            with os.fdopen(int(sys.argv[2]), "rb") as file:
                inputs = RunInputs.from_bytes(file.read())
            runner = PieceRunner(bundle, inputs, name, os.getppid())
    except Exception as err:
        _refuse_first_piece(connection, err)
        return 1
    _serve_pieces(connection, runner)
    return 0


if __name__ == "__main__":
    sys.exit(main())
