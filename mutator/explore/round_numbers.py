"""Round numbers: the sizes and durations from which a simpler fault is chosen."""

import math
from dataclasses import dataclass

_LEADING_DIGITS = {1: (1, 2, 5), 2: range(10, 100)}
_DECIMALS = 9  # to which multiples of a step are rounded


@dataclass(frozen=True, slots=True, kw_only=True)
class RoundNumbers:
    """Round numbers from `least` on. With a `step`, they are whole multiples of it."""

    least: float
    step: float | None = None

    def between(self, low: float, high: float, digits: int) -> tuple[float, ...]:
        """Return those strictly between two numbers, ascending: with one digit 1, 2 and 5, 10, 20 ...; with
        two digits 1, 1.1, 1.2 ...
        """
        first = max(low, self.least)
        if first >= high:
            return ()
        powers = range(math.floor(math.log10(first)) - 1, math.floor(math.log10(high)) + 1)
        # from text, so that 3e-1 is 0.3
        numbers = {
            self._multiple(float(f"{leading}e{power - digits + 1}"))
            for power in powers
            for leading in _LEADING_DIGITS[digits]
        }
        return tuple(sorted(number for number in numbers if low < number < high and number >= self.least))

    def below(self, number: float, count: int = 1) -> float | None:
        """Return the `count`-th smaller one of two digits, at most the least; None if there is none."""
        smaller = self.between(0.0, number, digits=2)
        return smaller[max(0, len(smaller) - count)] if smaller else None

    def at_least(self, number: float) -> float:
        """Return the smallest one of two digits that is not smaller than a number."""
        beyond = self.between(0.0, 3 * max(number, self.least), digits=2)
        return next((other for other in beyond if other >= number), number)

    def _multiple(self, number: float) -> float:
        if self.step is None:
            return number
        return round(max(1, round(number / self.step)) * self.step, _DECIMALS)
