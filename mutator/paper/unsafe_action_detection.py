"""Detects unsafe control actions in the traces of a golden and a faulty run."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mutator.model import Record
from mutator.outcomes.trace_and_record_loading import Trace

StepFlags = np.ndarray[tuple[int], np.dtype[np.bool_]]  # one flag per step

MIN_APPLIED_PEDAL_SHARE = 0.01  # share of full gas or brake; less is ignored
MIN_WRONG_PEDAL_S = 0.5  # minimum duration of wrong gas or brake
MIN_BRAKE_S = 0.1  # braking for less than this is ignored
MOST_TOO_SHORT_SHARE = 0.5  # up to this share of the golden run's braking time, braking is too short
MOST_ALERT_TO_RELEASE_S = 1.0  # maximum time from the alert to the last gas or brake
MIN_MISSED_USE_S = 0.1  # minimum duration of gas and of braking that only the golden run applies


@dataclass(frozen=True, slots=True, kw_only=True)
class RunPair:
    """A golden and a faulty run over their common steps, with a value for each step.

    The search covers `start_s` (the fault's activation) to `end_s` (the hazard, or the end of the run).
    """

    times_s: np.ndarray  # simulated time, s
    golden: Trace
    faulty: Trace
    step_s: float  # duration of a step, s
    start_s: float
    end_s: float
    alert_s: float | None  # time of the first alert after activation

    @classmethod
    def of(
        cls,
        golden: Trace,
        faulty: Trace,
        record: Record,
        time_channel: str,
        step_s: float,
        hazard: str | None,
    ) -> "RunPair":
        """Return the pair of an experiment with an activated fault, up to `hazard` or the end of the run."""
        # a hazard can end a drive early
        steps = min(len(golden[time_channel]), len(faulty[time_channel]))
        times_s = faulty[time_channel][:steps]
        assert record.activation is not None  # the query finds only activated faults
        return cls(
            times_s=times_s,
            golden={name: values[:steps] for name, values in golden.items()},
            faulty={name: values[:steps] for name, values in faulty.items()},
            step_s=step_s,
            start_s=record.activation.first,
            end_s=dict(record.hazards)[hazard] if hazard else float(times_s[-1]),
            alert_s=record.alerts[0][1] if record.alerts else None,
        )

    def steps_applied_by_golden_and_faulty(self, channel: str) -> tuple[StepFlags, StepFlags]:
        """Return the steps of the search in which the golden and the faulty run apply `channel`."""
        within = (self.times_s >= self.start_s) & (self.times_s <= self.end_s)
        return within & (self.golden[channel] > MIN_APPLIED_PEDAL_SHARE), within & (
            self.faulty[channel] > MIN_APPLIED_PEDAL_SHARE
        )

    def duration_s(self, steps: StepFlags) -> float:
        return float(steps.sum() * self.step_s)


StepFinder = Callable[[RunPair], StepFlags | None]  # the steps that show the action; None if there are none


@dataclass(frozen=True, slots=True, kw_only=True)
class ActionFigure:
    """A figure that needs the traces of one experiment."""

    name: str
    title: str
    query: str  # finds candidate runs by the columns of results.csv
    order_column: str  # candidates are examined in the order of this column, largest first
    what_it_shows: str  # describes what `find_steps` finds
    find_steps: StepFinder
    action_channels: tuple[str, ...]  # channels of the action, whose panels are shaded
    panels: tuple[tuple[str, str], ...]  # (channel, meaning), from the top
    hazard: str | None  # the search ends at this hazard; None: at the end of the run


def find_brake_too_short(pair: RunPair) -> StepFlags | None:
    """Return the steps in which only the golden run brakes.

    None unless the faulty run brakes, too, but at most half as long.
    """
    golden, faulty = pair.steps_applied_by_golden_and_faulty("brake")
    if not MIN_BRAKE_S <= pair.duration_s(faulty) <= MOST_TOO_SHORT_SHARE * pair.duration_s(golden):
        return None
    return golden & ~faulty


def build_wrong_time_finder(channel: str) -> StepFinder:
    """Return a function that finds the steps in which only the faulty run applies `channel`.

    The function returns None if these steps last less than MIN_WRONG_S.
    """

    def find_steps(pair: RunPair) -> StepFlags | None:
        golden, faulty = pair.steps_applied_by_golden_and_faulty(channel)
        only_faulty = faulty & ~golden
        return only_faulty if pair.duration_s(only_faulty) >= MIN_WRONG_PEDAL_S else None

    return find_steps


def find_gas_and_brake_unavailable(pair: RunPair) -> StepFlags | None:
    """Return the steps after the last gas or brake of the faulty run.

    None unless this last use came soon after the alert and the golden run still uses both.
    """
    is_used = (pair.faulty["gas"] > 0) | (pair.faulty["brake"] > 0)
    last_use_s = pair.times_s[is_used].max(initial=pair.start_s)
    after_last_use: StepFlags = pair.times_s > last_use_s
    missed_s = [
        pair.duration_s(after_last_use & (pair.golden[name] > MIN_APPLIED_PEDAL_SHARE))
        for name in ("gas", "brake")
    ]
    if (
        pair.alert_s is None
        or last_use_s > pair.alert_s + MOST_ALERT_TO_RELEASE_S
        or min(missed_s) < MIN_MISSED_USE_S
    ):
        return None
    return after_last_use


_GAS, _BRAKE = ("gas", "gas"), ("brake", "brake")
_DISTANCE, _SPEED = ("d_rel", "distance"), ("v_ego", "speed")
_WRONG_DATA_QUERY = 'module == "radar" and fault_type != "jamming" and status == "ok"'
ACTION_FIGURES = (
    ActionFigure(
        name="action_brake_too_short",
        title="Unsafe control action: brake for too short a time",
        query=f"{_WRONG_DATA_QUERY} and t_h1 > t_activation",
        order_column="max_dev_brake",
        what_it_shows=f"between activation and H1 the faulty run brakes, but for at most "
        f"{MOST_TOO_SHORT_SHARE:.0%} of the fault-free run's braking time "
        "(grey: the fault-free run brakes, the faulty one does not)",
        find_steps=find_brake_too_short,
        action_channels=("brake",),
        panels=(_BRAKE, _GAS, _DISTANCE),
        hazard="H1",
    ),
    ActionFigure(
        name="action_gas_at_a_wrong_time",
        title="Unsafe control action: gas at a wrong time",
        query=f"{_WRONG_DATA_QUERY} and t_h1 > t_activation",
        order_column="max_dev_gas",
        what_it_shows=f"between activation and H1 the faulty run applies gas for {MIN_WRONG_PEDAL_S} s or "
        "more while the fault-free run does not (grey)",
        find_steps=build_wrong_time_finder("gas"),
        action_channels=("gas",),
        panels=(_GAS, _BRAKE, _DISTANCE),
        hazard="H1",
    ),
    ActionFigure(
        name="action_brake_at_a_wrong_time",
        title="Unsafe control action: brake at a wrong time",
        query=f"{_WRONG_DATA_QUERY} and t_h2 > t_activation",
        order_column="max_dev_brake",
        what_it_shows=f"between activation and H2 the faulty run brakes for {MIN_WRONG_PEDAL_S} s or more "
        "while the fault-free run does not (grey)",
        find_steps=build_wrong_time_finder("brake"),
        action_channels=("brake",),
        panels=(_BRAKE, _GAS, _SPEED),
        hazard="H2",
    ),
    ActionFigure(
        name="action_unavailable_under_jamming",
        title="Gas and brake become unavailable under radar jamming",
        query='module == "radar" and fault_type == "jamming" and status == "ok" and t_alert >= t_activation '
        "and max_dev_gas > 0",
        order_column="max_dev_brake",
        what_it_shows=f"at most {MOST_ALERT_TO_RELEASE_S:.0f} s after the first alert, the faulty run stops "
        f"applying gas and brake (grey), while the fault-free run still applies each for "
        f"{MIN_MISSED_USE_S} s or more",
        find_steps=find_gas_and_brake_unavailable,
        action_channels=("gas", "brake"),
        panels=(_GAS, _BRAKE, _SPEED),
        hazard=None,
    ),
)
