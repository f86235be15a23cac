"""Parameters of a family: their possible values, and how likely each is."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise
from statistics import NormalDist

from mutator._common.message_text import describe_choices
from mutator.config.units import UNITS, Unit, convert_unit
from mutator.families.family_facts import ParameterFacts

ParameterValue = int | float | str


@dataclass(frozen=True, kw_only=True)
class Shape:
    """A distribution over a range. `normal` is in the parameter's unit; `log_normal` is that of a value whose
    logarithm is normal: its median, and the standard deviation of the logarithm.
    """

    normal: NormalDist
    is_logarithmic: bool = False


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A parameter. `name` is its key without the unit; `unit` is None for plain numbers and texts."""

    name: str
    key: str
    unit: Unit | None
    values: Sequence[ParameterValue]  #: all possible values, in the order of the file
    probabilities: Sequence[float] | None = None  #: of each value when it is drawn; None: equal ones
    is_range: bool = False  #: whether values between those of the range can be given by hand

    @property
    def is_number(self) -> bool:
        return not any(isinstance(value, str) for value in self.values)

    @property
    def numbers(self) -> list[int | float]:
        """The values that are numbers."""
        return [value for value in self.values if not isinstance(value, str)]

    def probability(self, index: int) -> float:
        """Return how likely a draw gives the value with this index."""
        return 1.0 / len(self.values) if self.probabilities is None else self.probabilities[index]

    def index_at(self, quantile: float) -> int:
        """Return the index of the value at a quantile, from 0 to less than 1."""
        if self.probabilities is None:
            return min(int(quantile * len(self.values)), len(self.values) - 1)
        return min(bisect_right(self._cumulative, quantile), len(self.values) - 1)

    @cached_property
    def _cumulative(self) -> list[float]:
        assert self.probabilities is not None
        return list(accumulate(self.probabilities))

    def numbers_by_name(self, value: ParameterValue) -> dict[str, ParameterValue]:
        """Return the value under each name that templates and constraints can use: `ego_kph`, `ego_mps` and
        so on, or the plain name without a unit.
        """
        if self.unit is None or isinstance(value, str):
            return {self.name: value}
        return {
            f"{self.name}_{unit.suffix}": value if unit == self.unit else convert_unit(value, self.unit, unit)
            for unit in UNITS.values()
            if unit.dimension == self.unit.dimension
        }

    @property
    def names_in_templates(self) -> tuple[str, ...]:
        return tuple(self.numbers_by_name(self.values[0]))

    def describe(self, value: ParameterValue) -> str:
        """Return the value with name and unit: `ego 60 km/h`."""
        return self.facts.describe(value)

    @property
    def facts(self) -> ParameterFacts:
        """What a run states about the parameter."""
        symbol = self.unit.symbol if self.unit else ""
        return ParameterFacts(key=self.key, name=self.name, unit=symbol, is_text=not self.is_number)

    def parse(self, text: str) -> ParameterValue | None:
        """Return the value in `text`; None unless it is one of the values, or within a range."""
        value = _parse_number(text) if self.is_number else text
        if (
            self.is_range
            and isinstance(value, int | float)
            and min(self.numbers) <= value <= max(self.numbers)
        ):
            return value
        return next((possible for possible in self.values if possible == value), None)

    def describe_values(self) -> str:
        """Return all values as text."""
        symbol = f" {self.unit.symbol}" if self.unit else ""
        if len(self.values) == 1:
            return f"{self.values[0]}{symbol}"
        if not self.is_range:
            return describe_choices([f"{value}" for value in self.values]) + symbol
        least, greatest = min(self.numbers), max(self.numbers)
        return f"a number from {least} to {greatest}{symbol}"


def _parse_number(text: str) -> int | float | None:
    for number_type in (int, float):
        try:
            return number_type(text)
        except ValueError:
            continue
    return None


def probabilities_of_shape(shape: Shape, values: Sequence[float], step: float) -> list[float]:
    """Return how likely each of these values is: the share of the distribution within half a step of it,
    relative to all of them. ValueError if the distribution has next to nothing there.
    """
    edges = [value - step / 2 for value in values] + [values[-1] + step / 2]
    shares = [_share_below(shape, edge) for edge in edges]
    total = shares[-1] - shares[0]
    if total < 1e-6:  # differences of smaller shares are noise
        raise ValueError("a distribution that has at least a millionth of its values in the range")
    return [(above - below) / total for below, above in pairwise(shares)]


def _share_below(shape: Shape, value: float) -> float:
    if not shape.is_logarithmic:
        return shape.normal.cdf(value)
    return shape.normal.cdf(math.log(value)) if value > 0 else 0.0
