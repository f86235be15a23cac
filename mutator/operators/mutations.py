"""What an operator makes of a place in a function: one mutation, which becomes one fault."""

from dataclasses import dataclass

from mutator.model import OPERATORS, Fault, FaultLocation, Injection, Value
from mutator.mutants.expressions import Expression
from mutator.mutants.statements import Statement
from mutator.operators.names import Operator

_LONGEST = 60  # characters of either side of a change
_AROUND = 20  # of what stays the same at either end of what differs


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """A fault model with its parameters, which an operator applies to an expression."""

    operator: Operator
    model: str
    params: tuple[tuple[str, Value], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutation:
    """One change of a function: `was` becomes `now`, in source.

    `place` is the expression whose value is another one, or the statement that is left out.
    """

    operator: Operator
    location: FaultLocation
    model: str
    params: tuple[tuple[str, Value], ...]
    place: Expression | Statement
    was: str
    now: str

    @property
    def line(self) -> int:
        """The line, from 0, on which its place begins."""
        return self.place.start[0] if isinstance(self.place, Expression) else self.place.first

    @property
    def text(self) -> str:
        """The change in a few words: `a + b -> a - b`."""
        was, now = " ".join(self.was.split()), " ".join(self.now.split())
        if max(len(was), len(now)) <= _LONGEST:
            return f"{was} -> {now}"
        before = max(0, _in_common(was, now) - _AROUND)
        after = max(0, _in_common(was[before:][::-1], now[before:][::-1]) - _AROUND)
        return " -> ".join(_part(text, before, after) for text in (was, now))

    def fault(self, reading: str) -> Fault:
        """The fault that is this change."""
        injection = Injection(location=self.location, model=self.model, params=self.params)
        return Fault(
            spec=f"{OPERATORS}/{self.operator}/{self.location.path}::{self.location.function}",
            module=OPERATORS,
            fault_type=self.operator.value,
            reading=reading,
            value=self.text,
            unit="-",
            aim="",
            injections=(injection,),
        )


def _in_common(one: str, other: str) -> int:
    """How many characters two texts begin with that are the same."""
    same = 0
    while same < min(len(one), len(other)) and one[same] == other[same]:
        same += 1
    return same


def _part(text: str, before: int, after: int) -> str:
    """What differs in a text and a little around it: without so many characters at either end, and, where it
    is long all the same, without its middle."""
    part = text[before : len(text) - after]
    half = _LONGEST // 2
    if len(part) > _LONGEST + 4:
        part = f"{part[:half]} .. {part[-half:]}"
    return f"{'.. ' if before else ''}{part}{' ..' if after else ''}"
