"""The forms of a fault among which the smallest one with the same hazard is looked for."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

from mutator.explore.round_numbers import RoundNumbers


class Axis(StrEnum):
    """What of a fault is a number that can be smaller."""

    DURATION = "duration"
    SIZE = "size"


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultForm:
    """A form of an experiment.

    * `injection`: the number of the only injection; None: all of them
    * `size`: how large the fault is, a positive number (see `SizeAxis`); None: it has no size
    * `start_s`: when the fault begins; None: when the experiment's trigger fires
    * `duration_s`: how long it lasts; None: as long as its trigger or its spec specifies
    """

    scenario: str
    injection: int | None = None
    size: float | None = None
    start_s: float | None = None
    duration_s: float | None = None

    def number(self, axis: Axis) -> float | None:
        """Return the number on an axis; None if it is not the form's."""
        return self.duration_s if axis is Axis.DURATION else self.size

    def with_number(self, axis: Axis, number: float) -> "FaultForm":
        """Return the form with another number on an axis."""
        if axis is Axis.DURATION:
            return replace(self, duration_s=number)
        return replace(self, size=number)


@dataclass(frozen=True, slots=True, kw_only=True)
class FormResult:
    """The result of a form that was driven.

    `hazard_s` is the time of the hazard in the drive, None without it; `ending` is the run's outcome, or its
    status.
    """

    experiment_id: str
    hazard_s: float | None
    ending: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SizeAxis:
    """The sizes of a fault, the smaller the simpler.

    With `values`, size 1 is the first of these, the simplest. Without, a size is an absolute value, whose
    sign is that of `largest`. `largest` is the experiment's value.
    """

    largest: float
    numbers: RoundNumbers
    values: tuple[float, ...] = ()

    @property
    def largest_size(self) -> float:
        return float(len(self.values)) if self.values else abs(self.largest)

    def value(self, size: float) -> float:
        """Return the fault's value of this size."""
        if self.values:
            return self.values[round(size) - 1]
        return -size if self.largest < 0 else size


@dataclass(frozen=True, slots=True, kw_only=True)
class FormSpace:
    """What can be simpler in an experiment that reached a hazard.

    * `original`: the experiment as it is, and `hazard_s`, when its hazard came
    * `start_s`: when its fault began, `last_active_s`, when it last acted, and `end_s`, the end of the drive
    * `longest_s`: how long the fault is allowed to last; None: its spec decides, so that a fault begins at
      `start_s` if `can_start_at_time`, or when its trigger fires
    * `scenarios`: simpler scenarios, the simplest first; `start_in` returns when the fault begins in one of
      them, or None if it never does
    * `step_s`: the target's step; `durations`: multiples of it
    """

    original: FaultForm
    hazard_s: float
    start_s: float
    last_active_s: float
    end_s: float
    longest_s: float | None
    can_start_at_time: bool
    scenarios: tuple[str, ...]
    start_in: Callable[[str], float | None]
    injection_count: int
    sizes: SizeAxis | None
    step_s: float
    durations: RoundNumbers
    changes_start: bool = False
