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

from mutator._common import shared_cache
from mutator._common.confined_files import path_below
from mutator._common.files import raising_disk_full
from mutator._common.hashing import canonical_json
from mutator._common.resource_shortages import find_shortage
from mutator.campaigns.run_inputs import RunInputs
from mutator.campaigns.shared_runs import group_by_run
from mutator.engines import sandbox
from mutator.engines.engine_choice import make_engine
from mutator.engines.engine_jobs import FAST, Job, Setting
from mutator.engines.reference_engine import ReferenceEngine
from mutator.errors import DiskFull, GoldenRunsDiffer, MutatorError, Shortage
from mutator.execution.cluster.golden_cache import DrivenGoldens
from mutator.execution.cluster.pieces import Ending, Kind, Piece, Result
from mutator.execution.cluster.unpacked_bundle import Site
from mutator.execution.experiment_runner import Finished, Goldens, Runner
from mutator.execution.worker import timing_of
from mutator.model import Experiment
from mutator.preflight.preflight_rules import read_check_run
from mutator.store.checksummed_blocks import block_bytes
from mutator.store.patch_files import pack_patches
from mutator.store.records import record_as_json
from mutator.store.run_folder import GoldenRun
from mutator.store.series_packing import series_block
from mutator.targets.required_packages import check_requirements


class PieceRunner:
    """Runs pieces in an unpacked bundle, and packs the results."""

    def __init__(self, site: Site, inputs: RunInputs, name: str, parent: int) -> None:
        self._site, self._name, self._parent = site, name, parent
        self._manifest, self._models = inputs.manifest, inputs.fault_models
        check_requirements(inputs.manifest)
        if inputs.manifest.sandbox:
            sandbox.check()
        self.place = site.place
        self._work = site.place / f"work-{os.getpid()}"
        self._work.mkdir()
        self._goldens = self._work / "golden"
        self._driven = DrivenGoldens(site, inputs.manifest)
        self._alike: set[str] = set()  # golden runs that equal the campaign's
        self._runners: dict[Kind, Runner] = {}

    def run(self, piece: Piece, tell: Callable[[str], None]) -> Result:
        """Run a piece. Calls `tell` with the id of each finished experiment.

        Raises GoldenRunsDiffer if a golden run made here differs from the campaign's.
        """
        began = time.monotonic()
        experiments = piece.experiments()
        # a shared run is compared with the golden run of its first experiment
        for same in group_by_run(self._manifest, experiments):
            if (key := self._golden_of(same[0]).key) not in self._alike:
                self._have_golden(key)
        runner = self._runner(piece.kind)
        finished: list[Finished] = []
        for one in runner.run(experiments):
            finished.append(one)
            tell(one.experiment.id)
        made = _made(finished, self._name, proof=piece.kind is Kind.PROVE)
        return replace(made, number=piece.number, seconds=time.monotonic() - began)

    def close(self) -> None:
        for runner in self._runners.values():
            runner.engine.close()

    def _runner(self, kind: Kind) -> Runner:
        if kind not in self._runners:
            site = self._site
            if kind is Kind.PROVE:
                engine = ReferenceEngine(
                    self._manifest, self._work, site.limits, self._parent, independent=True
                )
            else:
                setting = Setting(
                    manifest=self._manifest,
                    models=self._models,
                    work=self._work,
                    limits=site.limits,
                    parent=self._parent,
                )
                engine = make_engine(site.meta["engine"], setting)  # type: ignore[assignment]
            goldens = Goldens(
                self._manifest,
                lambda experiment: path_below(self._goldens, self._golden_of(experiment).key),
                several_seeds=site.meta["several_seeds"],
                digests={path_below(self._goldens, key): known for key, (_, known) in site.goldens.items()},
            )
            with_series = kind is Kind.RUN and site.meta["series"]
            self._runners[kind] = Runner(
                self._manifest, self._models, engine, goldens, site.scenario, with_series=with_series
            )
        return self._runners[kind]

    def _have_golden(self, key: str) -> None:
        """Make a golden run or copy it from the cache; GoldenRunsDiffer if it differs from the campaign's."""
        golden, known = self._site.goldens[key]
        place = path_below(self._goldens, key)
        self._goldens.mkdir(exist_ok=True)
        if not self._driven.fetch(golden, known, place):
            self._drive_golden(golden, known, place)
            self._driven.keep(golden, place)
        self._alike.add(key)

    def _drive_golden(self, golden: GoldenRun, known: str, place: Path) -> None:
        site = self._site
        engine = ReferenceEngine(self._manifest, self._work, site.limits, self._parent)
        job = Job(
            name=f"golden-{len(self._alike)}",
            scenario=site.scenario(golden.scenario),
            seed=site.meta["seed"] if golden.seed is None else golden.seed,
            changes=golden.changes,
        )
        for _, execution in engine.run([job]):
            found = read_check_run(self._manifest, execution)
            if found.problem or found.output_digest != known:
                came = found.problem or f"has the digest {found.output_digest[:16]} here, not {known[:16]}"
                raise GoldenRunsDiffer(f"golden run {golden.key} {came}")
            execution.out.rename(place)
            if golden.seed is not None:  # the images of a hundred seeds would fill the disk
                shared_cache.prune_target(self._manifest.cache_name)

    def _golden_of(self, experiment: Experiment) -> GoldenRun:
        return GoldenRun.for_experiment(experiment, several_seeds=self._site.meta["several_seeds"])


def _made(finished: list[Finished], name: str, *, proof: bool) -> Result:
    records = tuple(canonical_json(record_as_json(one.record)).encode() for one in finished)
    if proof:
        return Result(number=0, ending=Ending.DONE, records=records)
    patches = [(one.experiment.id, one.mutant.patch_bytes) for one in finished if one.mutant is not None]
    series = [(one.experiment.id, one.series) for one in finished if one.series is not None]
    return Result(
        number=0,
        ending=Ending.DONE,
        forked=any(one.mode in FAST for one in finished),
        records=records,
        timings=tuple(canonical_json(timing_of(one, name)).encode() for one in finished),
        patches=pack_patches(patches),
        series=b"".join(block_bytes(*series_block(experiment, one)) for experiment, one in series),
        series_of=tuple(sorted({one.golden_key for _, one in series})),
    )


def _result(runner: PieceRunner, piece: Piece, tell: Callable[[str], None]) -> Result:
    try:
        with raising_disk_full(runner.place):
            return runner.run(piece, tell)
    except GoldenRunsDiffer as err:
        return Result(number=piece.number, ending=Ending.UNLIKE, text=str(err))
    except Exception as err:
        known = err if isinstance(err, MutatorError) else find_shortage(err)
        short = isinstance(known, DiskFull | Shortage)
        text = str(known) if known else "".join(traceback.format_exception(err)).rstrip()
        return Result(number=piece.number, ending=Ending.UNFIT if short else Ending.FAILED, text=text)


def _serve(connection: Connection, runner: PieceRunner) -> None:
    try:
        with suppress(EOFError):
            while True:
                piece = Piece.of(connection.recv_bytes())
                connection.send(_result(runner, piece, connection.send).packed())
    finally:
        runner.close()


def _refuse(connection: Connection, err: Exception) -> None:
    """Answer the first piece with the reason why this process cannot run anything."""
    with suppress(EOFError):
        piece = Piece.of(connection.recv_bytes())
        text = str(err if isinstance(err, MutatorError) else find_shortage(err) or repr(err))
        connection.send(Result(number=piece.number, ending=Ending.UNFIT, text=text).packed())


def main() -> int:
    connection, site, name = Connection(int(sys.argv[1])), Site(Path(sys.argv[3])), sys.argv[4]
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the host handles these signals
    try:
        with raising_disk_full(site.place):
            with os.fdopen(int(sys.argv[2]), "rb") as file:
                inputs = RunInputs.from_bytes(file.read())
            runner = PieceRunner(site, inputs, name, os.getppid())
    except Exception as err:
        _refuse(connection, err)
        return 1
    _serve(connection, runner)
    return 0


if __name__ == "__main__":
    sys.exit(main())
