"""Shrinks an experiment: drives ever simpler forms of its fault as long as they keep the hazard."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from mutator._common.files import ScratchFolder
from mutator.api.envelope_shrinks import EnvelopeShrinker
from mutator.api.form_building import FormBuilder
from mutator.api.run_contents import RunContents
from mutator.api.smallest_form import SmallestForm
from mutator.api.target_and_fault_selection import SelectedTarget
from mutator.campaigns.bench_files import load_campaign_of_run
from mutator.campaigns.campaign_files import Campaign
from mutator.errors import CheckFailed, MutatorError
from mutator.execution.bench import Bench
from mutator.execution.bench_opening import finishing, opened_bench
from mutator.execution.single_run import manifest_of_unchanged_target, rerun_experiment
from mutator.explore.exploration_replay import is_exploration
from mutator.explore.fault_forms import Axis, FaultForm, FormSpace
from mutator.explore.round_numbers import RoundNumbers
from mutator.explore.shrink_run import golden_values_of, run_shrinking, trigger_start_s
from mutator.explore.shrinking import Shrinking
from mutator.model import OPERATOR_FAULTS_MODULE, Experiment, Hold, Outcome, Record
from mutator.store.records import PROOF_FOLDER
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import ProgressCallback
from mutator.triggers.conditions import TIME

_MOST_SCENARIOS = 6  # that are tried, the simplest first


@dataclass(frozen=True, eq=False)
class Shrinker:
    """Shrinks an experiment of a finished run that reached a hazard; MutatorError for another one."""

    run: RunContents
    experiment: Experiment
    record: Record
    changes_start: bool
    _start_and_end_by_scenario: dict[str, tuple[float | None, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        folder, name = self.run.folder, self.experiment.id
        if not folder.is_finished:
            raise MutatorError(
                "this run is not finished",
                where=folder.path,
                expected="a finished run, whose results are proved",
                remedy="finish it: the command that began it resumes it",
            )
        if self.record.outcome is not Outcome.HAZARD or not self.record.hazards:
            raise MutatorError(
                f"experiment {name} reached no hazard ({self.record.outcome or self.record.status})",
                where=folder.path,
                expected="an experiment with a hazard",
                remedy="`mutator show --run DIR --only 'outcome == \"hazard\"'` lists them",
            )

    def shrink(
        self, out: Path, *, workers: int, engine: str | None, notify: ProgressCallback | None
    ) -> SmallestForm:
        """Find the smallest form on a bench in the run folder `out`, or go on with it there.

        Where an envelope has the experiment, only its cells are looked at, unless the start may change.
        """
        self._builder.check_spec_unchanged()

        @contextmanager
        def open_bench() -> Iterator[Bench]:
            values = self._bench_values()
            with (
                opened_bench(
                    self.run.workspace, out, values, workers=workers, engine=engine, notify=notify
                ) as bench,
                finishing(bench),
            ):
                yield bench

        in_envelope = None if self.changes_start else self._in_envelope
        smallest = in_envelope.shrink(open_bench, out) if in_envelope else self._shrink_on(open_bench, out)
        self._prove(smallest)
        return smallest

    @property
    def _in_envelope(self) -> EnvelopeShrinker | None:
        return EnvelopeShrinker.of_experiment(
            self.run, self._selected_target, self._campaign, self.experiment, self.record
        )

    def _shrink_on(self, open_bench: Callable[[], AbstractContextManager[Bench]], out: Path) -> SmallestForm:
        with open_bench() as bench:
            shrinking = Shrinking(self._space(bench))
            run_shrinking(bench, shrinking, self._hazard, self._builder.build)
        return self._describe(shrinking, out)

    @property
    def _hazard(self) -> str:
        return self.record.hazards[0][0]

    @cached_property
    def _campaign(self) -> Campaign:
        return load_campaign_of_run(self.run.folder)

    @cached_property
    def _selected_target(self) -> SelectedTarget:
        workspace = self.run.workspace
        return SelectedTarget(workspace, manifest_of_unchanged_target(workspace, self.run.folder))

    @cached_property
    def _builder(self) -> FormBuilder:
        return FormBuilder(self._selected_target, self.experiment, is_exploration(self.run.folder))

    def _bench_values(self) -> dict[str, Any]:
        campaign = self._campaign
        values: dict[str, Any] = {
            "name": "shrink",
            "about": f"The smallest form of experiment {self.experiment.id} with hazard {self._hazard}.",
            "target": campaign.target,
            "reading": self.experiment.fault.reading,
            "seed": self.run.folder.head.seed,
            "after_hazard": self.experiment.after_hazard.value,
        }
        if campaign.canary is not None:
            values["canary"] = asdict(campaign.canary)
        if campaign.include is not None:
            values["include"] = campaign.include.value
        if limits := campaign.yaml_source.data.get("limits"):
            values["limits"] = dict(limits)
        return values

    def _space(self, bench: Bench) -> FormSpace:
        experiment, manifest, sizes = self.experiment, self._selected_target.manifest, self._builder.sizes
        original = FaultForm(scenario=experiment.scenario, size=sizes.largest_size if sizes else None)
        activation = self.record.activation
        assert activation is not None  # a hazard without one is not the fault's
        recorded_start_s, end_s = self._start_and_end(bench, original)
        start_s = activation.first if recorded_start_s is None else recorded_start_s

        def start_in(scenario: str) -> float | None:
            try:
                moved_start_s, _ = self._start_and_end(bench, replace(original, scenario=scenario))
            except CheckFailed:
                return None
            return start_s if recorded_start_s is None else moved_start_s

        return FormSpace(
            original=original,
            hazard_s=self.record.hazards[0][1],
            start_s=start_s,
            last_active_s=activation.last,
            end_s=end_s,
            longest_s=self._longest_s(end_s - start_s),
            can_start_at_time=experiment.fault.hold is not Hold.WHILE,
            scenarios=self._simpler_scenarios(),
            start_in=start_in,
            injection_count=1 if self._is_of_operator else len(experiment.fault.injections),
            sizes=sizes,
            step_s=manifest.step_s,
            durations=RoundNumbers(least=manifest.step_s, step=manifest.step_s),
            changes_start=self.changes_start,
        )

    def _start_and_end(self, bench: Bench, form: FaultForm) -> tuple[float | None, float]:
        """Return when the trigger fires in a scenario, None if that is not recorded or never happens, and
        when the drive ends.
        """
        if form.scenario not in self._start_and_end_by_scenario:
            manifest, experiment = self._selected_target.manifest, self._builder.build(form)
            golden = golden_values_of(bench, manifest, experiment)
            start_and_end = trigger_start_s(manifest, golden, experiment), float(golden[TIME][-1])
            self._start_and_end_by_scenario[form.scenario] = start_and_end
        return self._start_and_end_by_scenario[form.scenario]

    @property
    def _is_of_operator(self) -> bool:
        return self.experiment.fault.module == OPERATOR_FAULTS_MODULE

    def _longest_s(self, drive_s: float) -> float | None:
        """Return how long the fault is allowed to last, in s; None if its spec decides."""
        trigger = self.experiment.trigger
        if self.experiment.fault.hold in (Hold.TO_END, Hold.WHILE):
            return None
        return trigger.hold_s if trigger.hold is Hold.FOR else round(drive_s, 9)

    def _simpler_scenarios(self) -> tuple[str, ...]:
        """Return the library's scenarios that the campaign lists before the experiment's."""
        selections = self._campaign.scenario_selections
        scenario = self.experiment.concrete.family if self.experiment.concrete else self.experiment.scenario
        names = [name if isinstance(name, str) else name.family for name in selections]
        before = selections[: names.index(scenario)] if scenario in names else ()
        return tuple(name for name in before if isinstance(name, str))[:_MOST_SCENARIOS]

    def _notes(self, shrinking: Shrinking) -> tuple[str, ...]:
        hold = self.experiment.fault.hold
        notes = [*shrinking.notes, self._builder.note]
        if hold in (Hold.TO_END, Hold.WHILE):
            notes.append(f"the duration is that of the spec, which declares the hold `{hold.value}`")
        if self._is_of_operator:
            notes.append("a mutant of an operator: only start, duration and scenario can be simpler")
        if not self._campaign.scenario_selections:
            notes.append("no other scenario was tried: the run has no campaign that lists them in an order")
        return tuple(filter(None, notes))

    def _describe(self, shrinking: Shrinking, out: Path) -> SmallestForm:
        form, space, build = shrinking.smallest, shrinking.space, self._builder.build
        hazard_s = shrinking.hazard_s(form)
        assert hazard_s is not None  # the smallest form has it
        experiment, is_original = build(form), form == space.original
        run = self.run.path if is_original else out
        neighbours = {
            axis: smaller for axis in Axis if (smaller := shrinking.neighbour(form, axis)) is not None
        }
        _, end_s = self._start_and_end_by_scenario[form.scenario]
        start_s = space.start_s if form.scenario == space.original.scenario else space.start_in(form.scenario)
        return SmallestForm(
            original=self.experiment,
            experiment=experiment,
            record=self.record if is_original else RunFolder.open(out).records()[experiment.id],
            hazard=self._hazard,
            start_s=form.start_s if form.start_s is not None else start_s or 0.0,
            duration_s=form.duration_s,
            hazard_s=hazard_s,
            original_start_s=space.start_s,
            original_hazard_s=space.hazard_s,
            neighbours={axis: build(smaller) for axis, smaller in neighbours.items()},
            endings={axis: shrinking.results[smaller].ending for axis, smaller in neighbours.items()},
            observed_s=_observed_s(form, end_s),
            steps=tuple((step.what, build(step.form)) for step in shrinking.steps),
            runs=len(shrinking.results),
            notes=self._notes(shrinking),
            run=run,
            _workspace=self.run.workspace,
            _campaign=self._campaign,
            _injection=form.injection,
        )

    def _prove(self, smallest: SmallestForm) -> None:
        """Raise CheckFailed if the smallest form has another record on the reference engine."""
        if smallest.experiment.id in RunFolder.open(smallest.run).records(PROOF_FOLDER):
            return
        with ScratchFolder("mutator-shrink-") as scratch:
            _, is_same = rerun_experiment(
                self.run.workspace, smallest.run, smallest.experiment.id, out=scratch
            )
        if not is_same:
            raise CheckFailed(
                f"the smallest form, {smallest.experiment.id}, differs on the reference engine",
                where=smallest.run,
                expected="the same record from every engine",
                remedy="do not trust this run: use `--engine reference`, and report the problem",
            )


def _observed_s(form: FaultForm, end_s: float) -> float | None:
    if form.start_s is None or form.duration_s is None:
        return None
    return round(max(0.0, end_s - form.start_s - form.duration_s), 3)
