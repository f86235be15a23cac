"""Run one fault once, outside a campaign or as a rerun of a campaign's experiment."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import check_only_plain_files, checked_path_inside, path_below
from mutator._common.files import ScratchFolder
from mutator._common.hashing import digest
from mutator.api.experiment_results import ExperimentResult, TraceFrames, trace_frame
from mutator.api.scenario_choice import ScenarioLike, concrete_scenario_of
from mutator.api.target_and_fault_selection import FaultLike, SelectedTarget, TriggerLike, WorkspaceLike
from mutator.campaigns.phrase_collection import phrases_of_experiment
from mutator.campaigns.run_inputs import RunInputs
from mutator.errors import MutatorError
from mutator.execution.single_run import SingleRun, run_single
from mutator.figures.golden_and_faulty_plot import save_figure
from mutator.model import Experiment, Method, Record
from mutator.outcomes.hazard_and_metric_judgement import load_judged_run
from mutator.outcomes.trace_and_record_loading import Trace, load_trace
from mutator.results.columns_of_golden_hazards import golden_class_columns
from mutator.results.experiment_sentence import ExperimentSentences
from mutator.results.finished_experiments_and_columns import ResultColumn
from mutator.results.plan_columns import PlanColumn
from mutator.results.severity_and_sentence_columns import severity_and_time_columns
from mutator.results.table_columns import result_columns
from mutator.store.golden_runs import GoldenRun
from mutator.store.trial_file import StoredTrial
from mutator.targets.hazard_severity import SeverityScale
from mutator.targets.manifest import TargetManifest
from mutator.targets.stored_phrases import Phrases
from mutator.targets.stored_target_facts import ChannelFacts, channel_facts, metric_facts


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Trial(ExperimentResult):
    """An experiment that has just run, with its golden run.

    The output is in `folder`; a temporary folder is deleted with this object.
    """

    record: Record  #: the record of the run
    single: SingleRun  #: the run and its files
    manifest: TargetManifest  #: the target's manifest
    scale: SeverityScale | None = None  #: the severity scale; None for a target without one
    phrases: Phrases = field(default_factory=Phrases)  #: the words of the library for the sentence
    #: whether the record equals the campaign's; None: the campaign has none
    same_as_record: bool | None = None
    _temporary: ScratchFolder | None = field(default=None)  # deletes the folder together with this object

    @property
    def patch(self) -> str:
        """The whole patch, including the probe; empty for a mutant that does not compile."""
        return self.single.mutant.patch if self.single.mutant else ""

    @property
    def folder(self) -> Path:
        """The folder of the golden run (unless it is a campaign's), the faulty run and the patch."""
        return self.single.faulty.parent

    @property
    def log(self) -> str:
        """The last lines that the faulty run printed."""
        return self.single.log

    @property
    def has_trace(self) -> bool:
        """Whether the faulty run left a trace."""
        return (path_below(self.single.faulty, self.manifest.trace_file)).is_file()

    @property
    def golden_hazards(self) -> tuple[tuple[str, float], ...]:
        """Hazards (name, time in s) that the golden run also reaches, so the fault is not their cause.
        MutatorError if the golden run cannot be read.
        """
        _, judged = load_judged_run(self.manifest, self.single.golden)
        return tuple(sorted(judged.hazards, key=lambda hazard: hazard[1]))

    def traces(self) -> TraceFrames:
        """Return the golden and the faulty run as pandas frames; MutatorError without a faulty trace."""
        golden, faulty = self._load_traces()
        return TraceFrames(
            golden=trace_frame(golden, self.manifest), faulty=trace_frame(faulty, self.manifest)
        )

    def save_plot(self, path: Path) -> Path | None:
        """Write `plot()` to an .svg or .png file; return None if the faulty run left no trace."""
        if not self.has_trace:
            return None
        save_figure(self.plot(), [path])
        return path

    def _sentences(self) -> ExperimentSentences:
        return ExperimentSentences.of_target(self.manifest, self.phrases, self.scale)

    def _columns(self) -> Sequence[PlanColumn | ResultColumn]:
        compared = [channel.name for channel in self.manifest.compared_channels]
        severity = severity_and_time_columns(has_classes=self.scale is not None)
        metrics = metric_facts(self.manifest)
        golden_key = GoldenRun.for_experiment(self.experiment, several_seeds=False).key
        return result_columns(
            self.manifest.hazard_names,
            compared,
            metrics,
            severity,
            speed=bool(self.manifest.speed),
            golden_classes=golden_class_columns((golden_key,), several_seeds=False)
            if self.record.against_golden
            else (),
        )

    def _channels(self) -> Sequence[ChannelFacts]:
        return channel_facts(self.manifest)

    def _manifest(self) -> TargetManifest:
        return self.manifest

    def _load_traces(self) -> tuple[Trace, Trace]:
        if not self.has_trace:
            detail = f": {self.record.detail}" if self.record.detail else ""
            raise MutatorError(
                f"the faulty run left no trace ({self.ending}{detail})", remedy="see `.record` and `.log`"
            )
        return load_trace(self.manifest, self.single.golden), load_trace(self.manifest, self.single.faulty)


def try_fault(
    fault: FaultLike,
    scenario: ScenarioLike,
    trigger: TriggerLike = "always",
    *,
    value: float | None = None,
    reading: str | None = None,
    seed: int = 0,
    armed_after_s: float | None = None,
    target: str | None = None,
    workspace: WorkspaceLike = None,
    out: str | Path | None = None,
) -> Trial:
    """Inject one fault and run the scenario twice, once without the fault.

    `fault` and `trigger` are as for `build_mutant`; contexts, `always` and conditions are armed after
    `armed_after_s` (s; default: the manifest's). `scenario` is a name, a file, or a family
    with values: `r157_deceleration:ego=60,gap=20`. Output goes to a new folder
    in `out`; default: a temporary folder, deleted with the Trial.

    MutatorError for a mistake in the arguments, CheckFailed if the golden run fails. A crash of the
    controller or a harness error is a result: see `Trial.status`.
    """
    selected_target = SelectedTarget.of(workspace, target)
    concrete = concrete_scenario_of(selected_target.workspace, scenario)
    name = concrete.name if concrete else str(scenario)
    experiment = Experiment(
        fault=selected_target.fault(fault, value=value, seed=seed, reading=reading),
        scenario=name,
        scenario_digest=concrete.digest
        if concrete
        else digest(read_bounded(selected_target.workspace.scenario(name))),
        method=Method.GUIDED,
        trigger=selected_target.trigger(trigger, armed_after_s),
        seed=seed,
        concrete=concrete,
    )
    temporary = ScratchFolder("mutator-try-") if out is None else None
    out_folder = temporary.path if temporary else Path(out or "")
    # a link must not lead the output elsewhere
    folder = checked_path_inside(out_folder, path_below(out_folder, experiment.id))
    check_only_plain_files(folder)
    single = run_single(selected_target.workspace, selected_target.manifest, experiment, folder)
    inputs = RunInputs.of_experiments(selected_target.workspace, selected_target.manifest, [experiment])
    StoredTrial(
        target=selected_target.manifest.name,
        sources=inputs.digest_by_source(),
        experiment=experiment,
        record=single.record,
    ).write(folder)
    scale = selected_target.workspace.scale_of(selected_target.manifest)
    phrases = phrases_of_experiment(selected_target.workspace, selected_target.manifest, experiment)
    return build_trial(single, selected_target.manifest, scale=scale, phrases=phrases, temporary=temporary)


def build_trial(
    single: SingleRun,
    manifest: TargetManifest,
    *,
    scale: SeverityScale | None,
    phrases: Phrases,
    same_as_record: bool | None = None,
    temporary: ScratchFolder | None = None,
) -> Trial:
    return Trial(
        experiment=single.experiment,
        record=single.record,
        single=single,
        manifest=manifest,
        scale=scale,
        phrases=phrases,
        same_as_record=same_as_record,
        _temporary=temporary,
    )
