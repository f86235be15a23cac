"""What a worker does with experiments whose golden run has a hazard: leave them out, or judge what the fault
added.
"""

from dataclasses import dataclass

from mutator.execution.loaded_goldens import LoadedGoldens
from mutator.model import Experiment, GoldenClass, ObservedActivation
from mutator.outcomes.golden_hazard_rules import (
    HazardComparison,
    compare_with_golden,
    drive_hazards_of,
)
from mutator.outcomes.hazard_and_metric_judgement import RunJudgement
from mutator.outcomes.verdict_rules import first_events_after
from mutator.store.checks_file import HazardTimes, describe_golden_hazards
from mutator.store.golden_runs import GoldenRun
from mutator.targets.hazard_severity import SeverityScale


@dataclass(frozen=True, slots=True, kw_only=True)
class GoldenHazardRules:
    """`include`: the class of scenarios that run besides hazard-free ones; None: no other. `scale` says which
    hazard is worse.
    """

    include: GoldenClass | None = None
    scale: SeverityScale | None = None

    def leaves_out(self, goldens: LoadedGoldens, experiment: Experiment) -> bool:
        """Whether an experiment does not run, because its golden run has a hazard."""
        is_included = self.include is GoldenClass.HAZARD_WITHOUT_FAULT
        return not is_included and bool(goldens.hazards_of(experiment))

    def compare(
        self,
        goldens: LoadedGoldens,
        experiment: Experiment,
        judged: RunJudgement,
        activation: ObservedActivation | None,
        *,
        stopped_s: float | None,
    ) -> HazardComparison:
        """Return the hazards of a run that count, and how they compare with those of a golden run that has
        some. `stopped_s` is when the run was stopped: unless a terminal hazard did that, later hazards of the
        golden run do not count.
        """
        end_s = stopped_s if judged.t_end is None else None
        if not any(end_s is None or time <= end_s for _, time in goldens.hazards_of(experiment)):
            return HazardComparison(case=None, hazards=first_events_after(judged.hazards, activation))
        return compare_with_golden(
            drive_hazards_of(goldens.judgement_of(experiment), self.scale, end_s),
            drive_hazards_of(judged, self.scale),
            activation,
            step_s=goldens.step_s,
            was_stopped=stopped_s is not None and judged.t_end is not None,
        )


LEAVING_OUT = GoldenHazardRules()  # all experiments whose golden run has a hazard


def reason_left_out(experiment: Experiment, hazards: HazardTimes) -> str:
    """Return why an experiment did not run, whose golden run has these hazards."""
    name = GoldenRun.for_experiment(experiment, several_seeds=False).key
    return f"the golden run of {name} has a hazard without any fault: {describe_golden_hazards(hazards)}"
