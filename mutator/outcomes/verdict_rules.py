"""Verdicts on recorded runs, as pure functions."""

from collections.abc import Iterable, Sequence

from mutator.model import (
    AfterHazard,
    AgainstGolden,
    Experiment,
    Fault,
    Hold,
    ObservedActivation,
    Outcome,
    Record,
)
from mutator.targets.hazard_severity import DELTA_V_NAME, ClassifiedHazard, SeverityScale

EventTimes = Sequence[tuple[str, float]]  # (name, time in s), sorted by time


def first_events_after(
    events: Iterable[tuple[str, float]], activation: ObservedActivation | None
) -> EventTimes:
    """Return the first event of each name at or after activation, by time and then name.

    The fault cannot have caused earlier events.
    """
    if activation is None:
        return ()
    first: dict[str, float] = {}
    for name, time in events:
        if time >= activation.first and time < first.get(name, float("inf")):
            first[name] = time
    return tuple(sorted(first.items(), key=lambda event: (event[1], event[0])))


def outcome_of(
    *,
    activation: ObservedActivation | None,
    t_manifest: float | None,
    hazards: EventTimes,
    against_golden: AgainstGolden | None = None,
) -> Outcome:
    """Return the first of not_judged, not_activated, hazard, sdc and masked that applies.

    `hazards` are those at or after activation; if the golden run has hazards, only those that the fault
    added, moved forward or made worse. A hazard applies even without an actuator difference, because the
    fault can act on the world directly.
    """
    if against_golden is AgainstGolden.NOT_BEFORE:
        return Outcome.NOT_JUDGED
    if activation is None:
        return Outcome.NOT_ACTIVATED
    if hazards:
        return Outcome.HAZARD
    return Outcome.MASKED if t_manifest is None else Outcome.SDC


def reaction_time(hazards: EventTimes, alerts: EventTimes) -> float | None:
    """Return the time (s) from the first alert to the first hazard.

    A driver has at most this long to react, less if the hazard becomes inevitable before it
    comes. None unless both happened and the alert came first.
    """
    if not hazards or not alerts or alerts[0][1] >= hazards[0][1]:
        return None
    return hazards[0][1] - alerts[0][1]


def time_to_hazard(record: Record) -> float | None:
    """Return the time from activation to the first hazard, in s, also if the fault had ended by then. None
    without a hazard.
    """
    if not record.hazards or record.activation is None:
        return None
    return record.hazards[0][1] - record.activation.first


def was_active_at_hazard(record: Record, experiment: Experiment) -> bool:
    """Return whether the record shows that the fault still acted when the first hazard came.

    A fault without pauses acted if an activation came at the hazard or later. If it lasts to the end and the
    run stopped at the hazard, it acted, too, if its next activation was due by then, at the mean interval of
    its activations. A fault that can pause acted only if its first or last activation came at the very time
    of the hazard, because a record does not have the times of the others.
    """
    activation = record.activation
    if not record.hazards or activation is None:
        return False
    hazard = record.hazards[0][1]
    hold = experiment.fault.hold or experiment.trigger.hold
    if _can_pause(experiment.fault, hold):
        return hazard in (activation.first, activation.last)
    stopped_at_hazard = experiment.after_hazard is AfterHazard.STOP and record.t_end == hazard
    if hold is Hold.TO_END and stopped_at_hazard:
        mean_interval_s = (activation.last - activation.first) / max(activation.count - 1, 1)
        return activation.last + mean_interval_s >= hazard
    return activation.last >= hazard


def _can_pause(fault: Fault, hold: Hold) -> bool:
    """Return whether a fault can stop to act and act again: with `while`, and with injections that affect
    only some executions.
    """
    return hold is Hold.WHILE or any(i.where or i.call or i.every for i in fault.injections)


def manifestation_to_hazard_time(record: Record) -> float | None:
    """Return the time (s) from manifestation to the first hazard. None unless both happened in this order."""
    if not record.hazards or record.t_manifest is None or record.t_manifest > record.hazards[0][1]:
        return None
    return record.hazards[0][1] - record.t_manifest


def classified_hazard_of(record: Record, scale: SeverityScale | None) -> ClassifiedHazard | None:
    """Return the hazard of the highest severity class, of those that came after the activation and up to the
    end of the drive. None without a class.
    """
    if scale is None or record.activation is None:
        return None
    return scale.worst_hazard(record.hazards, dict(record.metrics), record.t_end)


def severity_class_of(record: Record, scale: SeverityScale | None) -> str | None:
    """Return the highest severity class of a hazard, as in `classified_hazard_of`."""
    worst = classified_hazard_of(record, scale)
    return worst.severity if worst else None


def missing_severity_reason(record: Record, scale: SeverityScale | None) -> str | None:
    """Return why no hazard of a run has a severity class. None if one has, or if there was no hazard."""
    if not record.hazards or record.activation is None or classified_hazard_of(record, scale):
        return None
    if scale is None:
        return "the target has no `severity`"
    return "; ".join(_unclassified_reason(name, record, scale) for name, _ in record.hazards)


def _unclassified_reason(hazard: str, record: Record, scale: SeverityScale) -> str:
    if dict(record.hazards)[hazard] > (float("inf") if record.t_end is None else record.t_end):
        return f"{hazard} came after the end of the drive"
    rules = [rule for rule in scale.rules if rule.hazard == hazard]
    if not rules and hazard != scale.contact:
        return f"the scale `{scale.name}` has no rule for {hazard}"
    metrics = dict(record.metrics)
    missing = [name for rule in rules for name in rule.metrics if name not in metrics]
    return f"{hazard} has no value of {', '.join(missing) or DELTA_V_NAME}"
