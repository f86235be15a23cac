"""What is observed of a target: values read at one place in each step, and values derived from them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

from mutator.model import FaultLocation
from mutator.triggers.conditions import TIME, names_in


@dataclass(frozen=True, slots=True, kw_only=True)
class ObservedValue:
    """An observed value. `text` is an expression at the place; for a derived value it is a formula over
    earlier values.
    """

    name: str
    text: str
    unit: str
    about: str


@dataclass(frozen=True, kw_only=True)
class Observation:
    """Where a target is observed. `time` is an expression for the time (s); if it is None, the probe counts
    steps.
    """

    location: FaultLocation
    time: str | None
    values: tuple[ObservedValue, ...]
    derived: tuple[ObservedValue, ...]

    @property
    def name_expression_pairs(self) -> tuple[tuple[str, str], ...]:
        time = () if self.time is None else ((TIME, self.time),)
        return (*time, *((value.name, value.text) for value in self.values))

    @cached_property
    def variables(self) -> tuple[str, ...]:
        """The names for conditions: the time, the observed values and the derived values."""
        return (TIME, *(value.name for value in (*self.values, *self.derived)))

    def names_with_inputs(self, names: Iterable[str]) -> frozenset[str]:
        """Return these names, and the inputs of those that are derived values."""
        needed = set(names)
        for value in reversed(self.derived):
            if value.name in needed:
                needed.update(names_in(value.text))
        return frozenset(needed)

    def names_for_trace_formulas(self, channels: Iterable[str]) -> tuple[str, ...]:
        """Return the names that formulas over a trace with these channels can use: time, channels, and values
        derived from them.
        """
        judgeable = dict.fromkeys((TIME, *(name for name in channels if name.isidentifier())))
        for value in self.derived:
            if all(name in judgeable for name in names_in(value.text)):
                judgeable[value.name] = None
        return tuple(judgeable)


def unit_and_meaning_by_name(observation: Observation) -> Mapping[str, tuple[str, str]]:
    """Return the unit and meaning of every name in conditions."""
    values = (*observation.values, *observation.derived)
    return {TIME: ("s", "time"), **{value.name: (value.unit, value.about) for value in values}}
