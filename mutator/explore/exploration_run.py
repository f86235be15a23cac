"""Runs an exploration on a bench."""

from collections.abc import Callable, Iterable, Sequence
from typing import Protocol

from mutator.campaigns.exploration_section import ExplorationSection, ExploredPlane
from mutator.errors import MutatorError
from mutator.execution.bench import Bench
from mutator.explore.cell_results import Drive
from mutator.explore.exploration import BatchLoop, BatchProposer, Proposal, reason_of_batch
from mutator.explore.golden_drives import drive_of, load_observed_values
from mutator.model import Experiment, Record, Status
from mutator.store.golden_runs import GoldenRun
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest


class BuildExperiment(Protocol):
    """Builds the experiment of a cell: a fault of this magnitude, from `start_s` on for `duration_s`. `form`
    is another seed of it, or a challenger.
    """

    def __call__(
        self,
        plane: ExploredPlane,
        magnitude: float | None,
        start_s: float,
        duration_s: float,
        form: str = "",
    ) -> Experiment: ...


def run_exploration(
    bench: Bench, proposer: BatchProposer, build: BuildExperiment, may_begin: Callable[[], bool]
) -> None:
    """Run an exploration, or go on with it, until nothing is proposed or `may_begin` says no. It is not asked
    for batches that the run folder answers.

    MutatorError if the harness failed in an experiment.
    """
    run = _BenchRun(bench, proposer, build)
    BatchLoop(
        exploration=proposer,
        begin=run.begin,
        finish=run.finish,
        may_begin=lambda batch: run.is_answered(batch) or may_begin(),
    ).run()


def find_drives(
    bench: Bench, manifest: TargetManifest, section: ExplorationSection, build: BuildExperiment
) -> list[Drive]:
    """Check the golden runs of the planes, and return the drive of each.

    MutatorError if a golden run never reaches the start of a plane; CheckFailed if one fails its checks.
    """
    # the golden run does not depend on magnitude, start and duration
    samples = [build(p, (*p.magnitudes, None)[0], 0.0, p.durations_s[0]) for p in section.planes]
    folders = bench.checked_golden_folders(samples)
    golden_runs = [GoldenRun.for_experiment(sample, several_seeds=True) for sample in samples]
    observed = {golden: load_observed_values(manifest, folder) for golden, folder in folders.items()}
    return [
        drive_of(manifest, observed[golden], plane)
        for golden, plane in zip(golden_runs, section.planes, strict=True)
    ]


class _BenchRun:
    """Begins and finishes the batches of an exploration on a bench."""

    def __init__(self, bench: Bench, proposer: BatchProposer, build: BuildExperiment) -> None:
        self._bench, self._proposer, self._build = bench, proposer, build
        self._experiment_ids: dict[Proposal, str] = {}
        self._records: dict[str, Record] = {}
        folder = RunFolder(bench.path)
        stored = folder.records().values() if RunFolder.exists(bench.path) else ()
        self._stored_ids = {r.experiment_id for r in stored if r.status is not Status.HARNESS_ERROR}

    def is_answered(self, batch: Sequence[Proposal]) -> bool:
        """Whether all experiments of a batch had their records when the bench was opened."""
        return bool(self._stored_ids) and all(
            self._build_experiment(proposal).id in self._stored_ids for proposal in batch
        )

    def begin(self, number: int, batch: Sequence[Proposal]) -> None:
        experiments = [self._build_experiment(proposal) for proposal in batch]
        self._experiment_ids |= {p: e.id for p, e in zip(batch, experiments, strict=True)}
        self._bench.submit(experiments, reason_of_batch(number))

    def finish(self, batch: Sequence[Proposal]) -> Iterable[Record]:
        experiment_ids = [self._experiment_ids[proposal] for proposal in batch]
        missing = set(experiment_ids) - self._records.keys()
        results = self._bench.results()
        while missing:
            record = next(results)
            self._records[record.experiment_id] = record
            missing.discard(record.experiment_id)
        for experiment_id in experiment_ids:
            check_harness(self._records[experiment_id])
        return [self._records[experiment_id] for experiment_id in experiment_ids]

    def _build_experiment(self, proposal: Proposal) -> Experiment:
        plane = self._proposer.section.planes[proposal.plane]
        line, duration = proposal.cell
        magnitude = plane.magnitudes[line] if plane.magnitudes else None
        start_s = self._proposer.drives[proposal.plane].start_s
        return self._build(plane, magnitude, start_s, plane.durations_s[duration], proposal.form)


def check_harness(record: Record) -> None:
    """Raise MutatorError for a harness error, from which nothing may be learned."""
    if record.status is Status.HARNESS_ERROR:
        raise MutatorError(
            f"harness error in experiment {record.experiment_id}: {record.detail}",
            remedy="run the same command again: what has finished is not repeated",
        )
