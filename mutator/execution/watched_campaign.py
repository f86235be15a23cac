"""The passes of `mutator watch`: each runs a campaign as its files are at the moment, in a bench of its own.

The folder has the runs of two passes: `now`, and `before` it. Workers, checks and golden runs of a scenario
come when the first experiment needs them, so the first verdict does not wait for the others.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from mutator._common.files import make_folder
from mutator._common.folder_locks import lock_run_folder
from mutator._common.hashing import as_json_types, digest
from mutator.campaigns.plan import Plan, build_plan
from mutator.campaigns.run_inputs import RunInputs
from mutator.errors import MutatorError
from mutator.execution.bench import Bench
from mutator.execution.bench_opening import finishing, opened_bench
from mutator.execution.earlier_benches import EarlierBenches
from mutator.execution.earlier_run import CAN_RECORD_CODE
from mutator.execution.session_summary import Summary
from mutator.model import Experiment, Outcome, Record
from mutator.store.golden_runs import GoldenRun
from mutator.store.plan_choices import Choices
from mutator.store.run_deletion import delete_run
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import ProgressCallback
from mutator.workspace import Workspace

NOW, BEFORE = "now", "before"
Verdict = tuple[str, str, tuple[str, ...]]  # status, outcome, hazards


def verdict_of(record: Record) -> Verdict:
    return record.status.value, record.outcome.value if record.outcome else "", hazard_names(record)


def hazard_names(record: Record) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for name, _ in record.hazards))


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedPass:
    """What a pass runs. `inputs` is a digest of all that decides the verdicts."""

    plan: Plan
    bench_values: Mapping[str, Any]
    inputs: str


class WatchedCampaign:
    """A campaign that is run pass after pass in `folder`. The caller holds `lock_watch_folder`."""

    def __init__(
        self,
        workspace: Workspace,
        campaign: str | Path,
        folder: Path,
        *,
        choices: Choices,
        workers: int,
        engine: str | None,
    ) -> None:
        self._workspace, self._campaign, self._choices = workspace, campaign, choices
        self._workers, self._engine = workers, engine
        self.run_path, self._before_path = folder / NOW, folder / BEFORE
        self._earlier = EarlierBenches()
        self.verdicts = self._stored_verdicts()  # of the last pass that ended
        self._finished_inputs = ""

    def plan(self) -> PlannedPass:
        """Plan the campaign as its files are now; MutatorError for a mistake in them."""
        plan = build_plan(self._workspace, self._campaign, self._choices)
        manifest = self._workspace.manifest(plan.campaign.target)
        sources = RunInputs.of_plan(self._workspace, manifest, plan.tally).digest_by_source()
        scale = self._workspace.scale_of(manifest)
        values = _bench_values(plan)
        ids = [experiment.id for experiment in plan.experiments]
        inputs = digest([ids, values, sources, as_json_types(scale) if scale else None])
        return PlannedPass(plan=plan, bench_values=values, inputs=inputs)

    def is_finished(self, planned: PlannedPass) -> bool:
        """Whether the last pass that ended has these verdicts."""
        return planned.inputs == self._finished_inputs

    def run(
        self,
        planned: PlannedPass,
        on_records: Callable[[Sequence[Record]], None],
        notify: ProgressCallback | None = None,
    ) -> Summary:
        """Run a pass after `make_room`. Its records are handed over in parts. After an interruption, the next
        pass goes on with what has finished.

        MutatorError for a mistake in the files, or if the bench fails; CheckFailed if a check does.
        """
        self._earlier.since = self._run_before() if CAN_RECORD_CODE else None
        received: dict[str, Record] = {}
        try:
            with self._opened_bench(planned, notify) as bench:
                for batch in self._batches(planned.plan.experiments):
                    bench.submit(batch)
                    records = []
                    for record in bench.results():
                        received[record.experiment_id] = record
                        records.append(record)
                    on_records(records)
        finally:
            self._earlier.note_cut_off(received)
        assert bench.summary is not None
        self.verdicts = {name: verdict_of(record) for name, record in received.items()}
        if RunFolder(self.run_path).is_finished:
            self._earlier.note_finished()
            self._finished_inputs = planned.inputs
        return bench.summary

    @contextmanager
    def _opened_bench(self, planned: PlannedPass, notify: ProgressCallback | None) -> Iterator[Bench]:
        with (
            opened_bench(
                self._workspace,
                self.run_path,
                planned.bench_values,
                workers=self._workers,
                engine=self._engine,
                earlier=self._earlier,
                notify=notify,
            ) as bench,
            finishing(bench),
        ):
            yield bench

    def _batches(self, experiments: Sequence[Experiment]) -> Iterator[list[Experiment]]:
        """Yield first what somebody waits for: experiments that the last pass did not have or else the worst
        ones, of one golden run; then the others. Nothing is more urgent if all are new.
        """
        new = [experiment for experiment in experiments if experiment.id not in self.verdicts]
        if len(new) == len(experiments):
            yield new
            return
        first = new[0] if new else min(experiments, key=self._is_no_hazard)
        golden_run = _golden_run_of(first)
        urgent = [e for e in (new or experiments) if _golden_run_of(e) == golden_run]
        yield urgent
        ids = {experiment.id for experiment in urgent}
        if others := [experiment for experiment in experiments if experiment.id not in ids]:
            yield others

    def _is_no_hazard(self, experiment: Experiment) -> bool:
        return self.verdicts[experiment.id][1] != Outcome.HAZARD.value

    def make_room(self) -> None:
        """Make a finished run the one before, and delete one that was cut off. Not to be interrupted."""
        self._finished_inputs = ""  # `now` will be that of another pass
        if not RunFolder.exists(self.run_path):
            return
        if not RunFolder(self.run_path).is_finished:
            delete_run(self.run_path)
            return
        if RunFolder.exists(self._before_path):
            delete_run(self._before_path)
        elif self._before_path.exists():
            raise MutatorError(
                "the rest of a run that was being deleted",
                where=self._before_path,
                expected="the run of the pass before, or no folder",
                remedy="delete this folder",
            )
        self.run_path.rename(self._before_path)

    def _run_before(self) -> RunFolder | None:
        return RunFolder.open(self._before_path) if RunFolder.exists(self._before_path) else None

    def _stored_verdicts(self) -> dict[str, Verdict]:
        """Return the verdicts of the last pass of an earlier command; MutatorError if a folder has another
        kind of run, which would be deleted.
        """
        verdicts: dict[str, Verdict] = {}
        for path in (self._before_path, self.run_path):
            if not RunFolder.exists(path):
                continue
            folder = RunFolder.open(path)
            if not folder.is_bench:
                raise MutatorError(
                    f"holds a run of campaign '{folder.head.campaign}' that `mutator watch` did not make",
                    where=path,
                    argument="out",
                    expected="a folder of `mutator watch`, or a new or empty one",
                    remedy="choose another `out`",
                )
            if folder.is_finished:
                verdicts = {name: verdict_of(record) for name, record in folder.records().items()}
        return verdicts


@contextmanager
def lock_watch_folder(folder: Path) -> Iterator[None]:
    """Create the folder of the passes, and lock it; MutatorError if it is a run folder, or in use."""
    if RunFolder.exists(folder):
        raise MutatorError(
            "a run folder",
            where=folder,
            argument="out",
            expected="a folder for the runs of passes: one of `mutator watch`, or a new or empty one",
            remedy="choose another `out`",
        )
    make_folder(folder)
    with lock_run_folder(folder, patience_s=0.0):
        yield


def _bench_values(plan: Plan) -> dict[str, Any]:
    campaign = plan.campaign
    values: dict[str, Any] = {"name": campaign.name, "about": campaign.purpose, "target": campaign.target}
    values |= {"reading": plan.reading, "seed": plan.seed, "after_hazard": campaign.after_hazard.value}
    if campaign.include is not None:
        values["include"] = campaign.include.value
    if campaign.canary is not None:
        values["canary"] = asdict(campaign.canary)
    if limits := campaign.yaml_source.data.get("limits"):
        values["limits"] = dict(limits)
    return values


def _golden_run_of(experiment: Experiment) -> GoldenRun:
    return GoldenRun.for_experiment(experiment, several_seeds=True)
