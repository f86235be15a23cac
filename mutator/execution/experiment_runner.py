"""Turn experiments into records: build each mutant, run it, compare it with its golden run, judge it."""

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.hashing import digest
from mutator.campaigns.shared_runs import group_by_run
from mutator.engines.engine_jobs import Engine, Job, JobResult, RunMode
from mutator.engines.executed_functions import ExecutedFunctions
from mutator.errors import BadAddition, BadOutput, InvalidMutant, MutatorError
from mutator.execution.golden_hazards import LEAVING_OUT, GoldenHazardRules, reason_left_out
from mutator.execution.inactivity_check import InactivityCheck
from mutator.execution.loaded_goldens import LoadedGoldens, changed_file_error
from mutator.execution.records_without_outcome import (
    record_of_mutant_without_outcome,
    record_without_outcome,
)
from mutator.faults.fault_models import FaultModels
from mutator.model import AfterHazard, AgainstGolden, Experiment, ObservedActivation, Record, Status
from mutator.mutants.injection_edits import is_in_tree
from mutator.mutants.mutant_building import Mutant, build
from mutator.mutants.probe_contract import activation_of
from mutator.outcomes import golden_trace_comparison, trace_and_record_loading
from mutator.outcomes.actuator_change_and_speeds import (
    end_of_run,
    first_actuator_change,
    share_in_direction,
    speeds_after_activation,
)
from mutator.outcomes.channel_departures import departures_from_golden
from mutator.outcomes.defence_reports import load_defence_activities
from mutator.outcomes.failure_cause import judge_failure, run_error
from mutator.outcomes.hazard_and_metric_judgement import (
    RunJudgement,
    is_engaged_at_end,
    load_judged_run,
)
from mutator.outcomes.lost_observed_values import find_lost_value
from mutator.outcomes.trace_and_record_loading import Trace
from mutator.outcomes.verdict_rules import first_events_after, outcome_of
from mutator.store.checks_file import describe_golden_hazards
from mutator.store.series_format import encode_series
from mutator.store.series_packing import EncodedSeries
from mutator.targets.manifest import TargetManifest


@dataclass(frozen=True, kw_only=True)
class RecordedExperiment:
    """An experiment with its record.

    `output_folder` (of the target) is valid until the next result; None without a mutant or a run.
    `series` is None if not requested or if the run failed. `packages` are those of a copied run.
    """

    experiment: Experiment
    record: Record
    mutant: Mutant | None = None
    output_folder: Path | None = None
    cpu_s: float = 0.0
    wall_s: float = 0.0
    log_tail: str = ""
    mode: RunMode | None = None  # None if nothing ran
    fallback_reason: str = ""
    fork_step: int = 0
    series: EncodedSeries | None = None
    third_party_modules: tuple[str, ...] = ()
    executed_functions: ExecutedFunctions | None = None
    packages: Mapping[str, str | None] | None = None

    @property
    def is_copied(self) -> bool:
        """Whether the record is that of another run."""
        return self.mode in (RunMode.REUSED, RunMode.UNAFFECTED)


@dataclass(frozen=True, kw_only=True)
class CopiedRun:
    """The result of an earlier run, which an experiment gets instead of a run of its own.

    `mode` says why it can. `why` is what the timing adds to it. `packages` are the versions of those that the
    run loaded.
    """

    record: Record
    faulty_series: bytes | None
    mode: RunMode
    why: str = ""
    executed_functions: ExecutedFunctions | None
    packages: Mapping[str, str | None]


FindCopiedRun = Callable[[Experiment, Mutant], CopiedRun | None]


def find_nothing(experiment: Experiment, mutant: Mutant) -> None:
    """Find no run to copy."""


class ExperimentRunner:
    """Runs experiments on an engine, which chooses their order."""

    def __init__(
        self,
        manifest: TargetManifest,
        models: FaultModels,
        engine: Engine,
        goldens: LoadedGoldens,
        scenario_file: Callable[[str], Path],
        *,
        golden_hazard_rules: GoldenHazardRules = LEAVING_OUT,
        with_series: bool = False,
        inactivity_check: InactivityCheck | None = None,
        find_copied_run: FindCopiedRun = find_nothing,
    ) -> None:
        self.inactivity_check = inactivity_check  # None: records do not say why a fault was never active
        self.manifest = manifest
        self.models = models
        self.engine = engine
        self.goldens = goldens
        self.scenario_file = cache(scenario_file)
        self.with_series = with_series
        self._find_copied_run = find_copied_run
        self._golden_hazard_rules = golden_hazard_rules

    def run(self, experiments: Iterable[Experiment]) -> Iterator[RecordedExperiment]:
        """Yield each experiment with its record.

        Experiments that the golden hazard rules leave out come first. A mutant that cannot be built is not
        run, nor an experiment that gets a copied run. Experiments that share a run get the same record.
        """
        shared: dict[str, list[Experiment]] = {}
        for same in group_by_run(self.manifest, experiments):
            self.goldens.read_and_verify_files_of(same[0])
            if self._golden_hazard_rules.leaves_out(self.goldens, same[0]):
                yield from map(self._leave_out, same)
            else:
                shared[same[0].id] = same
        for finished in self._run_distinct([same[0] for same in shared.values()]):
            yield finished
            for other in shared[finished.experiment.id][1:]:
                record = replace(finished.record, experiment_id=other.id)
                yield replace(finished, experiment=other, record=record, cpu_s=0.0, wall_s=0.0)

    def close(self) -> None:
        """End the processes that the engines keep between runs."""
        self.engine.close()
        if self.inactivity_check is not None:
            self.inactivity_check.close()

    def _run_distinct(self, experiments: Iterable[Experiment]) -> Iterator[RecordedExperiment]:
        without_job: deque[RecordedExperiment] = deque()
        started: dict[str, tuple[Experiment, Mutant]] = {}

        def jobs() -> Iterator[Job]:
            for experiment in experiments:
                try:
                    built = build(self.manifest, self.models, experiment.fault, experiment.trigger)
                except MutatorError as err:
                    without_job.append(self._finish_without_run(experiment, err))
                    continue
                self.goldens.read_and_verify_files_of(experiment)
                if (run := self._find_copied_run(experiment, built)) is not None:
                    without_job.append(self._copy_run(experiment, built, run))
                    continue
                started[experiment.id] = (experiment, built)
                yield self._build_job(experiment, built)

        for job, execution in self.engine.run(jobs()):
            while without_job:  # the engine has just asked for more jobs, and some had none
                yield without_job.popleft()
            yield self._finish_run(*started.pop(job.name), execution)
        yield from without_job

    def _leave_out(self, experiment: Experiment) -> RecordedExperiment:
        reason = reason_left_out(experiment, self.goldens.hazards_of(experiment))
        record = record_without_outcome(experiment.id, Status.LEFT_OUT, reason)
        return RecordedExperiment(experiment=experiment, record=record)

    def _copy_run(self, experiment: Experiment, mutant: Mutant, run: CopiedRun) -> RecordedExperiment:
        series = None
        if self.with_series and run.faulty_series is not None:
            series = self._series_beside_golden(experiment, run.faulty_series)
        return RecordedExperiment(
            experiment=experiment,
            record=replace(run.record, experiment_id=experiment.id),
            mutant=mutant,
            mode=run.mode,
            fallback_reason=run.why,
            series=series,
            executed_functions=run.executed_functions,
            packages=run.packages,
        )

    def _build_job(self, experiment: Experiment, mutant: Mutant) -> Job:
        stop = experiment.after_hazard is AfterHazard.STOP
        return Job(
            name=experiment.id,
            scenario=self.scenario_file(experiment.scenario),
            seed=experiment.seed,
            scenario_changes=experiment.changes,
            changed_files=mutant.files,
            mutant_id=mutant.id,
            probe_source=mutant.probe_source,
            injection_ids=mutant.injection_ids,
            ids_before_anchor=mutant.ids_before_anchor,
            golden_folder=self.goldens.folder_of(experiment),
            stop_at_hazard=stop,
            end_s=experiment.end_s,
            golden_end=self.goldens.end_of(experiment) if stop else None,
            note_executed_functions=True,
        )

    def _finish_without_run(self, experiment: Experiment, err: MutatorError) -> RecordedExperiment:
        status = Status.INVALID_MUTANT if isinstance(err, InvalidMutant) else Status.HARNESS_ERROR
        place = f"{self.manifest.tree.path_as_in_specs(err.where)}: " if err.where else ""
        return RecordedExperiment(
            experiment=experiment,
            record=record_of_mutant_without_outcome(experiment, status, place + err.got, None),
        )

    def _finish_run(self, experiment: Experiment, mutant: Mutant, execution: JobResult) -> RecordedExperiment:
        faulty = None
        try:
            record, faulty = self._build_record(experiment, mutant, execution)
        except (BadOutput, BadAddition) as err:
            record = record_of_mutant_without_outcome(
                experiment, Status.HARNESS_ERROR, _describe_problem(err), mutant
            )
        self._check_input_unchanged(experiment)
        return RecordedExperiment(
            experiment=experiment,
            record=record,
            mutant=mutant,
            output_folder=execution.out,
            cpu_s=execution.cpu_s,
            wall_s=execution.wall_s,
            log_tail=execution.log_tail,
            mode=execution.mode,
            fallback_reason=execution.fallback_reason,
            fork_step=execution.fork_step,
            series=self._encode_series(experiment, record, faulty) if faulty is not None else None,
            third_party_modules=execution.third_party_modules,
            executed_functions=execution.executed_functions,
        )

    def _check_input_unchanged(self, experiment: Experiment) -> None:
        """Raise MutatorError if a run has written to what this experiment used, so its record would not
        count.
        """
        self.goldens.check_unchanged(experiment)
        scenario = self.scenario_file(experiment.scenario)
        if digest(read_bounded(scenario)) != experiment.scenario_digest:
            raise changed_file_error(scenario)

    def _encode_series(self, experiment: Experiment, record: Record, faulty: Trace) -> EncodedSeries | None:
        if not self.with_series:
            return None
        sampler = self.goldens.sampler_of(experiment)
        faulty_bytes = encode_series(sampler.faulty_series(faulty, record), sampler.golden)
        return self._series_beside_golden(experiment, faulty_bytes)

    def _series_beside_golden(self, experiment: Experiment, faulty_bytes: bytes) -> EncodedSeries:
        return EncodedSeries(
            golden_key=self.goldens.golden_key_of(experiment),
            golden_bytes=self.goldens.sampler_of(experiment).encoded_golden,
            faulty_bytes=faulty_bytes,
        )

    def _injections_that_raise(self, experiment: Experiment, mutant: Mutant) -> set[str]:
        tree, injections = self.manifest.tree, experiment.fault.injections
        models = [self.models.get(each.model) for each in injections if is_in_tree(each, tree)]
        return {name for name, model in zip(mutant.injection_ids, models, strict=True) if model.raises}

    def _build_record(
        self, experiment: Experiment, mutant: Mutant, execution: JobResult
    ) -> tuple[Record, Trace | None]:
        if execution.status is not Status.OK or execution.probe_report is None:
            return self._record_of_failed_run(experiment, mutant, execution), None
        activation = activation_of(execution.probe_report)
        reference = self.goldens.trace_of(experiment)
        try:
            faulty, judged = load_judged_run(self.manifest, execution.out, reference)
        except BadOutput as err:
            if activation is None:
                raise
            return record_of_mutant_without_outcome(
                experiment, Status.CRASHED, _describe_problem(err), mutant, activation
            ), None
        record = self._record_of_completed_run(experiment, mutant, execution, faulty, judged)
        return record, faulty if record.status is Status.OK else None

    def _record_of_completed_run(
        self,
        experiment: Experiment,
        mutant: Mutant,
        execution: JobResult,
        faulty: Trace,
        judged: RunJudgement,
    ) -> Record:
        activation = activation_of(execution.probe_report or {})
        reference, time = self.goldens.trace_of(experiment), self.manifest.time_channel
        stopped_s = float(faulty[time][-1]) if execution.was_stopped else None
        if stopped_s is not None:
            least_s = math.inf if experiment.end_s is None else experiment.end_s - self.manifest.step_s / 2
            if judged.t_end is None and stopped_s < least_s:
                why = f"was stopped at {stopped_s} s, but neither by a terminal hazard nor at its end"
                return record_of_mutant_without_outcome(experiment, Status.HARNESS_ERROR, why, mutant)
            reference = trace_and_record_loading.trace_until(reference, stopped_s, time)
        faulty = trace_and_record_loading.with_golden_times(reference, faulty, time)
        if lost := find_lost_value(self.manifest, reference, faulty, judged.t_end):
            problem = golden_trace_comparison.reason_not_by_fault(lost.time_s, activation)
            status, detail = (
                (Status.HARNESS_ERROR, f"{lost}: {problem}") if problem else (Status.CRASHED, str(lost))
            )
            bare = record_of_mutant_without_outcome(experiment, status, detail, mutant, activation)
            return bare if problem else replace(bare, t_end=lost.time_s)
        difference = golden_trace_comparison.compare_traces(
            reference, faulty, self.manifest.compared_channels, time, judged.t_end
        )
        if problem := golden_trace_comparison.reason_not_by_fault(difference.t_first, activation):
            return record_of_mutant_without_outcome(experiment, Status.HARNESS_ERROR, problem, mutant)
        compared = self._golden_hazard_rules.compare(
            self.goldens, experiment, judged, activation, stopped_s=stopped_s
        )
        hazards = compared.hazards
        end = hazards[0][1] if hazards else judged.t_end
        change = first_actuator_change(
            reference, faulty, self.manifest.compared_channels, time, difference.t_first
        )
        return Record(
            experiment_id=experiment.id,
            status=Status.OK,
            outcome=outcome_of(
                activation=activation,
                t_manifest=difference.t_first,
                hazards=hazards,
                against_golden=compared.case,
            ),
            detail=self._detail(experiment, execution, compared.case, activation),
            tree=mutant.tree_digest,
            activation=activation,
            t_manifest=difference.t_first,
            max_dev=difference.max_dev,
            hazards=tuple(hazards),
            alerts=tuple(first_events_after(judged.alerts, activation)),
            trace_digest=trace_and_record_loading.trace_digest(self.manifest, execution.out),
            patch=digest(mutant.patch_bytes),
            t_end=judged.t_end,
            dev=() if judged.t_end is None else difference.max_dev_in_drive,
            metrics=judged.metrics,
            left=departures_from_golden(reference, faulty, self.manifest.channels, time, judged.t_end),
            first_change=change,
            first_change_share=share_in_direction(reference, faulty, time, change, end),
            speeds=speeds_after_activation(self.manifest, reference, faulty, activation, end),
            against_golden=compared.case,
            golden_hazards=tuple(compared.golden_hazards),
            t_back=difference.t_back,
            ended_disengaged=not judged.is_engaged_at_end and is_engaged_at_end(self.manifest, reference),
            defences=load_defence_activities(self.manifest, execution.out),
            run_end=end_of_run(self.manifest, faulty) if self.manifest.defences else None,
        )

    def _detail(
        self,
        experiment: Experiment,
        execution: JobResult,
        case: AgainstGolden | None,
        activation: ObservedActivation | None,
    ) -> str:
        """Return why a fault was never active, or cannot be judged; else empty."""
        if case is AgainstGolden.NOT_BEFORE:
            hazards = describe_golden_hazards(self.goldens.hazards_of(experiment))
            return f"it was not active before the hazard of the golden run: {hazards}"
        if activation is not None or self.inactivity_check is None:
            return ""
        scenario = self.scenario_file(experiment.scenario)
        return self.inactivity_check.reason(experiment, scenario, execution.probe_report or {})

    def _record_of_failed_run(self, experiment: Experiment, mutant: Mutant, execution: JobResult) -> Record:
        status, detail = judge_failure(
            execution,
            mutant.files,
            self._injections_that_raise(experiment, mutant),
            mutant.ids_before_anchor,
        )
        # the number of activations before a crash is reproducible; before a timeout it is not
        activation = activation_of(execution.probe_report or {}) if status is Status.CRASHED else None
        bare = record_of_mutant_without_outcome(experiment, status, detail, mutant, activation)
        return replace(bare, error=run_error(execution.exception))


def _describe_problem(err: MutatorError) -> str:
    return f"{Path(err.where or '').name}: {err.got}"
