"""Detects unsafe control actions in the traces of a golden and a faulty run."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mutator.model import Record
from mutator.outcomes.golden_comparison import Trace

Steps = np.ndarray[tuple[int], np.dtype[np.bool_]]  # one flag per step

APPLIED = 0.01  # share of full gas or brake; less is ignored
WRONG_S = 0.5  # minimum duration of wrong gas or brake
BRAKE_S = 0.1  # braking for less than this is ignored
SHORT = 0.5  # up to this share of the golden run's braking time, braking is too short
RELEASED_S = 1.0  # maximum time from the alert to the last gas or brake
MISSED_S = 0.1  # minimum duration of gas and of braking that only the golden run applies


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """A golden and a faulty run over their common steps, with a value for each step.

    The search covers `start` (the fault's activation) to `end` (the hazard, or the end of the run).
    """

    t: np.ndarray  # simulated time, s
    golden: Trace
    faulty: Trace
    step_s: float  # duration of a step, s
    start: float
    end: float
    alert: float | None  # time of the first alert after activation

    @classmethod
    def of(
        cls, golden: Trace, faulty: Trace, record: Record, time: str, step_s: float, hazard: str | None
    ) -> "Pair":
        """Return the pair of an experiment with an activated fault, up to `hazard` or the end of the run."""
        steps = min(len(golden[time]), len(faulty[time]))
        t = faulty[time][:steps]
        assert record.activation is not None  # the query finds only activated faults
        return cls(
            t=t,
            golden={name: values[:steps] for name, values in golden.items()},
            faulty={name: values[:steps] for name, values in faulty.items()},
            step_s=step_s,
            start=record.activation.first,
            end=dict(record.hazards)[hazard] if hazard else float(t[-1]),
            alert=record.alerts[0][1] if record.alerts else None,
        )

    def applied(self, channel: str) -> tuple[Steps, Steps]:
        """Return the steps from `start` to `end` in which the golden and the faulty run apply `channel`."""
        within = (self.t >= self.start) & (self.t <= self.end)
        return within & (self.golden[channel] > APPLIED), within & (self.faulty[channel] > APPLIED)

    def seconds(self, steps: Steps) -> float:
        return float(steps.sum() * self.step_s)


Look = Callable[[Pair], Steps | None]  # the steps that show the action; None if there are none


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """A figure that needs the traces of one experiment."""

    name: str
    title: str
    query: str  # finds candidate runs by the columns of results.csv
    order: str  # candidates are examined in the order of this column, largest first
    confirmed: str  # describes what `look` finds
    look: Look
    actions: tuple[str, ...]  # channels of the action, whose panels are shaded
    panels: tuple[tuple[str, str], ...]  # (channel, meaning), from the top
    hazard: str | None  # the search ends at this hazard; None: at the end of the run


def brake_too_short(pair: Pair) -> Steps | None:
    """Return the steps in which only the golden run brakes.

    None unless the faulty run brakes, too, but at most half as long.
    """
    golden, faulty = pair.applied("brake")
    if not BRAKE_S <= pair.seconds(faulty) <= SHORT * pair.seconds(golden):
        return None
    return golden & ~faulty


def at_a_wrong_time(channel: str) -> Look:
    """Return a function that finds the steps in which only the faulty run applies `channel`.

    The function returns None if these steps last less than WRONG_S.
    """

    def look(pair: Pair) -> Steps | None:
        golden, faulty = pair.applied(channel)
        wrong = faulty & ~golden
        return wrong if pair.seconds(wrong) >= WRONG_S else None

    return look


def both_unavailable(pair: Pair) -> Steps | None:
    """Return the steps after the last gas or brake of the faulty run.

    None unless this last use came soon after the alert and the golden run still uses both.
    """
    used = (pair.faulty["gas"] > 0) | (pair.faulty["brake"] > 0)
    last = pair.t[used].max(initial=pair.start)
    gone: Steps = pair.t > last
    missed = [pair.seconds(gone & (pair.golden[name] > APPLIED)) for name in ("gas", "brake")]
    if pair.alert is None or last > pair.alert + RELEASED_S or min(missed) < MISSED_S:
        return None
    return gone


_GAS, _BRAKE = ("gas", "gas"), ("brake", "brake")
_DISTANCE, _SPEED = ("d_rel", "distance"), ("v_ego", "speed")
_WRONG_DATA = 'module == "radar" and fault_type != "jamming" and status == "ok"'
WANTED = (
    Wanted(
        name="action_brake_too_short",
        title="Unsafe control action: brake for too short a time",
        query=f"{_WRONG_DATA} and t_h1 > t_activation",
        order="max_dev_brake",
        confirmed=f"between activation and H1 the faulty run brakes, but for at most {SHORT:.0%} of the "
        "fault-free run's braking time (grey: the fault-free run brakes, the faulty one does not)",
        look=brake_too_short,
        actions=("brake",),
        panels=(_BRAKE, _GAS, _DISTANCE),
        hazard="H1",
    ),
    Wanted(
        name="action_gas_at_a_wrong_time",
        title="Unsafe control action: gas at a wrong time",
        query=f"{_WRONG_DATA} and t_h1 > t_activation",
        order="max_dev_gas",
        confirmed=f"between activation and H1 the faulty run applies gas for {WRONG_S} s or more while the "
        "fault-free run does not (grey)",
        look=at_a_wrong_time("gas"),
        actions=("gas",),
        panels=(_GAS, _BRAKE, _DISTANCE),
        hazard="H1",
    ),
    Wanted(
        name="action_brake_at_a_wrong_time",
        title="Unsafe control action: brake at a wrong time",
        query=f"{_WRONG_DATA} and t_h2 > t_activation",
        order="max_dev_brake",
        confirmed=f"between activation and H2 the faulty run brakes for {WRONG_S} s or more while the "
        "fault-free run does not (grey)",
        look=at_a_wrong_time("brake"),
        actions=("brake",),
        panels=(_BRAKE, _GAS, _SPEED),
        hazard="H2",
    ),
    Wanted(
        name="action_unavailable_under_jamming",
        title="Gas and brake become unavailable under radar jamming",
        query='module == "radar" and fault_type == "jamming" and status == "ok" and t_alert >= t_activation '
        "and max_dev_gas > 0",
        order="max_dev_brake",
        confirmed=f"at most {RELEASED_S:.0f} s after the first alert, the faulty run stops applying gas and "
        f"brake (grey), while the fault-free run still applies each for {MISSED_S} s or more",
        look=both_unavailable,
        actions=("gas", "brake"),
        panels=(_GAS, _BRAKE, _SPEED),
        hazard=None,
    ),
)
