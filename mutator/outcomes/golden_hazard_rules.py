"""Verdicts on runs whose golden run has a hazard, as pure functions: what came of it, and what the fault
added.
"""

import math
from dataclasses import dataclass

from mutator.model import AgainstGolden, ObservedActivation
from mutator.outcomes.hazard_and_metric_judgement import RunJudgement
from mutator.outcomes.verdict_rules import EventTimes
from mutator.targets.hazard_severity import ClassifiedHazard, SeverityScale

_TIME_SLACK_S = 1e-9  # s; times are sums of steps


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveHazards:
    """The hazards of a drive, by time: those after its end at `t_end` (s) do not count. `classified` is the
    worst of them; None without a class of severity.
    """

    times: EventTimes
    t_end: float | None = None
    classified: ClassifiedHazard | None = None

    @property
    def first_s(self) -> float:
        """When the first hazard came, or the drive ended; infinite if neither happened."""
        ends = () if self.t_end is None else (self.t_end,)
        return min((*(time for _, time in self.times), *ends), default=float("inf"))

    @property
    def severity(self) -> str:
        return self.classified.severity if self.classified else ""


@dataclass(frozen=True, slots=True, kw_only=True)
class HazardComparison:
    """What became of golden's hazards: `hazards` are those that the fault added, moved forward or made worse,
    `golden_hazards` the others of the drive. `case` is None if the fault was never active.
    """

    case: AgainstGolden | None
    hazards: EventTimes = ()
    golden_hazards: EventTimes = ()


def drive_hazards_of(
    judged: RunJudgement, scale: SeverityScale | None, end_s: float | None = None
) -> DriveHazards:
    """Return the hazards of a run, without those after the end of its drive, and after `end_s`, at which the
    run that is compared with it ended.
    """
    last_s = min(math.inf if end is None else end for end in (judged.t_end, end_s))
    times = tuple((name, time) for name, time in judged.hazards_by_time if time <= last_s)
    classified = scale.worst_hazard(times, dict(judged.metrics), judged.t_end) if scale else None
    return DriveHazards(times=times, t_end=judged.t_end, classified=classified)


def compare_with_golden(
    golden: DriveHazards,
    faulty: DriveHazards,
    activation: ObservedActivation | None,
    *,
    step_s: float,
    was_stopped: bool = False,
) -> HazardComparison:
    """Compare the hazards of a run with those of its golden run, which has some.

    The first case of `AgainstGolden` that applies decides. Times that differ by one step (`step_s`) are the
    same. `was_stopped`: the run ended at a hazard, so that a fault that was never active could still have
    become so.
    """
    if activation is None and not was_stopped:
        return HazardComparison(case=None)
    if activation is None or activation.first >= golden.first_s:
        return HazardComparison(case=AgainstGolden.NOT_BEFORE, golden_hazards=faulty.times)
    golden_times = dict(golden.times)
    most_s = step_s + _TIME_SLACK_S
    another = [name for name, _ in faulty.times if name not in golden_times]
    moved_s = {name: time - golden_times[name] for name, time in faulty.times if name in golden_times}
    earlier = [name for name, by_s in moved_s.items() if by_s < -most_s]
    added, case = {*another, *earlier}, AgainstGolden.SAME
    is_worse = faulty.classified is not None and faulty.severity > golden.severity
    if added:
        case = AgainstGolden.ANOTHER if another else AgainstGolden.EARLIER
    elif is_worse:
        case = AgainstGolden.WORSE
    elif moved_s.keys() != golden_times.keys():
        case = AgainstGolden.MISSING
    elif any(by_s > most_s for by_s in moved_s.values()):
        case = AgainstGolden.LATER
    if is_worse and faulty.classified:  # also one of golden, beside another or an earlier one
        added.add(faulty.classified.hazard)
    return HazardComparison(
        case=case,
        hazards=tuple(event for event in faulty.times if event[0] in added),
        golden_hazards=tuple(event for event in faulty.times if event[0] not in added),
    )
