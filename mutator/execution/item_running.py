"""Runs the items of a campaign in the process that got them: what has no record yet, and its proof."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from mutator._common.pickled_values import PickledValue
from mutator.campaigns.expectations import Expectation
from mutator.engines.engine_jobs import MODES_TO_PROVE
from mutator.execution.experiment_runner import RecordedExperiment
from mutator.execution.listed_items import ListedItem
from mutator.execution.unexpected_results import describe_unexpected_result
from mutator.execution.worker import Worker, WorkerStart
from mutator.execution.written_files import FileDigests
from mutator.model import Experiment, Record, Status
from mutator.preflight import equivalence_check
from mutator.store.plan_file import ExperimentsReadOnAccess
from mutator.store.run_folder import RunFolder


@dataclass(frozen=True, slots=True, kw_only=True)
class ItemEnding:
    """Why an item fails, if it does, and why its experiments were left out, if all were."""

    problems: Sequence[str] = ()
    reason_left_out: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ItemsStart(PickledValue):
    """What a process needs to run items of a campaign, once its checks have passed.

    `pending` are positions of experiments without a final record; `unproved` are ids of the equivalence
    check's sample that have not run on the reference engine. `problem` is why nothing can run, if so; with
    `endings`, nothing has to.
    """

    worker: WorkerStart | None = None
    pending: frozenset[int] = frozenset()
    unproved: frozenset[str] = frozenset()
    endings: Mapping[str, ItemEnding] = field(default_factory=dict)  # of items whose work is done, by name
    has_forked: bool = False  # whether the run folder has an experiment that needs the proof
    expectation: Expectation | None = None  # of all experiments
    expectation_by_id: Mapping[str, Expectation] = field(default_factory=dict)
    replay_options: tuple[str, ...] = ()  # with which a user's command finds library and target
    problem: str = ""


class ItemRunner:
    """Runs items of a run folder. `make_worker` makes the worker of this process for the first that must run:
    in a finished run, nothing is written.
    """

    def __init__(self, folder: RunFolder, start: ItemsStart, make_worker: Callable[[], Worker]) -> None:
        self._folder, self._make_worker = folder, make_worker
        self._worker: Worker | None = None
        self._pending, self._unproved = set(start.pending), set(start.unproved)
        self._has_forked = start.has_forked
        self._expectation, self._expectation_by_id = start.expectation, start.expectation_by_id
        self._replay_options = start.replay_options
        self._planned = ExperimentsReadOnAccess(folder.path, folder.head.chunks)
        self._proofs_to_decide: list[Experiment] = []  # nothing was forked yet

    def run(self, item: ListedItem) -> ItemEnding:
        """Run what has no record; return how the item ends."""
        experiments = {position: self._planned[position] for position in item.positions}
        ended = {finished.experiment.id: finished for finished in self._run_pending(experiments)}
        problems, reasons_left_out = list[str](), list[str]()
        for experiment in experiments.values():
            finished = ended.get(experiment.id)
            record = finished.record if finished else self._stored_record_of(experiment)
            if record is None:
                continue
            if record.status is Status.HARNESS_ERROR:
                problems.append(f"{experiment.id}: {record.detail}")
                continue
            if record.status is Status.LEFT_OUT:
                reasons_left_out.append(record.detail)
                continue
            if experiment.id in self._unproved:
                problems += self._prove_or_defer(experiment)
            problems += self._unexpected_result(experiment, record, finished)
        are_all_left_out = len(reasons_left_out) == len(experiments)
        return ItemEnding(problems=problems, reason_left_out=reasons_left_out[0] if are_all_left_out else "")

    def prove_rest(self) -> None:
        """Prove what ran before anything was forked, if anything was since, in any process."""
        experiments, self._proofs_to_decide = self._proofs_to_decide, []
        if experiments and equivalence_check.reason_check_not_needed(self._folder) is None:
            for _ in self._ensure_worker().prove_experiments(experiments):
                pass

    def close(self) -> FileDigests:
        """Close the worker's files; return their digests."""
        if self._worker is None:
            return {}
        self._worker.close()
        return self._worker.file_digests

    def _ensure_worker(self) -> Worker:
        self._worker = self._worker or self._make_worker()
        return self._worker

    @cached_property
    def _stored_records(self) -> Mapping[str, Record]:
        """The records that the run folder had when this was first asked for."""
        return self._folder.records()

    def _run_pending(self, experiments: dict[int, Experiment]) -> Iterator[RecordedExperiment]:
        position_by_id = {e.id: position for position, e in experiments.items() if position in self._pending}
        pending = [experiments[position] for position in position_by_id.values()]
        for finished in self._ensure_worker().run_and_store(pending) if pending else ():
            if finished.record.status is not Status.HARNESS_ERROR:
                self._pending.discard(position_by_id[finished.experiment.id])
            self._has_forked |= finished.mode in MODES_TO_PROVE
            yield finished

    def _stored_record_of(self, experiment: Experiment) -> Record | None:
        """Return the record of an earlier session, if anything depends on it."""
        needs_record = self._expectation_of(experiment) is not None or experiment.id in self._unproved
        needs_record |= self._folder.golden_run_of(experiment).key in self._left_out_goldens
        return self._stored_records.get(experiment.id) if needs_record else None

    @cached_property
    def _left_out_goldens(self) -> Collection[str]:
        return self._folder.left_out_goldens

    def _expectation_of(self, experiment: Experiment) -> Expectation | None:
        return self._expectation_by_id.get(experiment.id, self._expectation)

    def _prove_or_defer(self, experiment: Experiment) -> list[str]:
        self._unproved.discard(experiment.id)
        if not self._has_forked:
            self._proofs_to_decide.append(experiment)
            return []
        return [
            f"{record.experiment_id}, in the proof: {record.detail}"
            for record in self._ensure_worker().prove_experiments([experiment])
            if record.status is Status.HARNESS_ERROR
        ]

    def _unexpected_result(
        self, experiment: Experiment, record: Record, finished: RecordedExperiment | None
    ) -> list[str]:
        folder = self._folder
        expectation = self._expectation_of(experiment)
        problem = expectation.problem_with(record, folder.severity_scale) if expectation else ""
        if not problem:
            return []
        if finished is not None and finished.mutant is not None:
            patch = finished.mutant.patch_bytes
        else:
            patch = folder.read_patch(experiment.id, record) or b""
        options = self._replay_options
        return [describe_unexpected_result(folder, experiment, record, patch, problem, options)]


class FinishedItems:
    """The items of a file whose work is done: how each ends, by its name."""

    def __init__(self, endings: Mapping[str, ItemEnding]) -> None:
        self._endings = endings

    def run(self, item: ListedItem) -> ItemEnding:
        """Return how the item ends."""
        return self._endings[item.name]
