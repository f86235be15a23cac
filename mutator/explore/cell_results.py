"""What a run says about its cell, and about the cells of longer faults."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from mutator.limits import MOST_LIMIT_OR_TIME
from mutator.model import Outcome, Record, Status
from mutator.outcomes.golden_trace_comparison import BACK_TO_GOLDEN_S
from mutator.targets.hazard_and_metric_definitions import MARGIN_PREFIX


class CellState(StrEnum):
    """What is said of a cell."""

    HAZARDOUS = "hazardous"  # driven: a hazard followed
    WITHOUT_HAZARD = "without_hazard"  # driven: no hazard within the window
    DISENGAGED = "disengaged"  # driven: no hazard, but the controller ended disengaged or crashed
    NOT_DECIDED = "not_decided"  # driven, but neither can be said
    INFERRED = "inferred"  # not driven: a shorter fault reached a hazard while it was active
    BETWEEN_HAZARDOUS = "between_hazardous"  # not driven, between hazardous cells
    BETWEEN_WITHOUT = "between_without"  # not driven, between cells without hazard
    UNKNOWN = "unknown"  # not driven, and its neighbours differ

    @property
    def is_hazardous(self) -> bool:
        return self in (CellState.HAZARDOUS, CellState.INFERRED, CellState.BETWEEN_HAZARDOUS)

    @property
    def is_failed(self) -> bool:
        """Whether the cell is not survived: hazardous, or the controller ended disengaged."""
        return self.is_hazardous or self is CellState.DISENGAGED

    @property
    def is_without_hazard(self) -> bool:
        return self in (CellState.WITHOUT_HAZARD, CellState.BETWEEN_WITHOUT)


_DIGITS = 6  # of times in s, as starts have
MOST_TIME_MARGIN_MS = 10**9  # also of a drive without such a metric


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """The drive in which faults start: times in s. `step_s` is the target's. `time_margin_ms` says how
    critical the golden run is at the start: the shortest of its times to other traffic, in ms.
    """

    start_s: float
    end_s: float
    step_s: float
    time_margin_ms: int = MOST_TIME_MARGIN_MS


@dataclass(frozen=True, slots=True, kw_only=True)
class CellResult:
    """The result of a driven cell.

    * `hazard`, `time_to_hazard_s`: the first hazard, and its time after the start of the fault; None without
    * `inferred_from_s`: the shortest duration for which the hazard follows from this run; None if it came
      after the end of the fault, which may then have caused it
    * `margins`: the smallest distance from each hazard that has a margin, by metric
    * `reason`: why the cell is not decided, or how the controller ended
    * `is_activated`: whether the injected code ran while the fault was active
    * `is_judged`: whether the run went on as planned, so that no hazard in it means that there was none
    """

    state: CellState
    experiment_id: str
    hazard: str = ""
    time_to_hazard_s: float | None = None
    inferred_from_s: float | None = None
    margins: Mapping[str, float] = field(default_factory=dict)
    reason: str = ""
    is_activated: bool = True
    is_judged: bool = True


def end_of_observation(start_s: float, duration_s: float, observe_s: float) -> float:
    """Return when the run of a cell ends (s), unless its scenario or a hazard ends it before."""
    return min(round(start_s + duration_s + observe_s, _DIGITS), float(MOST_LIMIT_OR_TIME))


def judge_cell(record: Record, duration_s: float, drive: Drive, observe_s: float) -> CellResult:
    """Judge the run of a fault that began at `drive.start_s` and lasted `duration_s`.

    Without a hazard, the drive must have gone on for `observe_s` after the fault, or have come back to the
    golden run after it.
    """
    margins = {name: value for name, value in record.metrics if name.startswith(MARGIN_PREFIX)}
    name = record.experiment_id
    if record.status is Status.CRASHED:
        reason = record.detail or "the controller crashed"
        return CellResult(state=CellState.DISENGAGED, experiment_id=name, reason=reason, is_judged=False)
    if record.status is not Status.OK or record.outcome is Outcome.NOT_JUDGED:
        reason = record.detail or f"the run ended as {record.status}"
        return CellResult(state=CellState.NOT_DECIDED, experiment_id=name, reason=reason, is_judged=False)
    if record.outcome is Outcome.HAZARD:
        hazard, time = record.hazards[0]
        return _hazardous_cell(name, hazard, time - drive.start_s, duration_s, drive.step_s, margins)
    if record.ended_disengaged:
        reason = "the controller was disengaged at the end"
        return CellResult(state=CellState.DISENGAGED, experiment_id=name, margins=margins, reason=reason)
    observed_s = drive.end_s - drive.start_s - duration_s
    if observed_s >= observe_s - drive.step_s / 2 or _came_back(record, duration_s, drive):
        is_activated = record.outcome is not Outcome.NOT_ACTIVATED
        state = CellState.WITHOUT_HAZARD
        return CellResult(state=state, experiment_id=name, margins=margins, is_activated=is_activated)
    return CellResult(
        state=CellState.NOT_DECIDED,
        experiment_id=name,
        margins=margins,
        reason=f"the drive ends {max(observed_s, 0.0):.2f} s after the fault",
    )


def _came_back(record: Record, duration_s: float, drive: Drive) -> bool:
    """Whether the run was as golden from some time after the fault on, up to its end, and for long enough."""
    fault_end_s = drive.start_s + duration_s
    left_s = fault_end_s if record.t_manifest is None else record.t_back
    return (
        left_s is not None and drive.end_s - max(left_s, fault_end_s) >= BACK_TO_GOLDEN_S - drive.step_s / 2
    )


def _hazardous_cell(
    name: str,
    hazard: str,
    time_to_hazard_s: float,
    duration_s: float,
    step_s: float,
    margins: Mapping[str, float],
) -> CellResult:
    # Up to the hazard, a longer fault does the same. Two steps more, because the fault's last step acts on
    # the truth of the step after it.
    needed_s = round(time_to_hazard_s + 2 * step_s, 9)
    return CellResult(
        state=CellState.HAZARDOUS,
        experiment_id=name,
        hazard=hazard,
        time_to_hazard_s=round(time_to_hazard_s, 9),
        inferred_from_s=needed_s if needed_s <= duration_s else None,
        margins=margins,
    )
