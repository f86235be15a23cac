"""Mutations: changes that operators make in a function. Each becomes one fault."""

from dataclasses import dataclass

from mutator.model import OPERATOR_FAULTS_MODULE, Fault, FaultLocation, Injection, Value
from mutator.mutants.changeable_expressions import Expression
from mutator.mutants.function_statements import Statement

_MOST_CHARACTERS = 60  # characters; longer texts are abbreviated
_CONTEXT_CHARACTERS = 20  # unchanged characters kept before and after the change


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutation:
    """One change to a function: the source text `source_before` becomes `source_after`.

    `mutated_part` is the changed expression or the omitted statement.
    """

    operator: str
    location: FaultLocation
    model: str
    params: tuple[tuple[str, Value], ...]
    mutated_part: Expression | Statement
    source_before: str
    source_after: str

    @property
    def line(self) -> int:
        """The line on which the place begins, counted from 0."""
        return (
            self.mutated_part.start[0]
            if isinstance(self.mutated_part, Expression)
            else self.mutated_part.first_line
        )

    @property
    def description(self) -> str:
        """The change, abbreviated: `a + b -> a - b`."""
        was, now = " ".join(self.source_before.split()), " ".join(self.source_after.split())
        if max(len(was), len(now)) <= _MOST_CHARACTERS:
            return f"{was} -> {now}"
        before = max(0, _common_prefix_length(was, now) - _CONTEXT_CHARACTERS)
        after = max(0, _common_prefix_length(was[before:][::-1], now[before:][::-1]) - _CONTEXT_CHARACTERS)
        return " -> ".join(_abbreviate(text, before, after) for text in (was, now))

    def to_fault(self, reading: str) -> Fault:
        injection = Injection(location=self.location, model=self.model, params=self.params)
        return Fault(
            spec=f"{OPERATOR_FAULTS_MODULE}/{self.operator}/{self.location.path}::{self.location.function}",
            module=OPERATOR_FAULTS_MODULE,
            fault_type=self.operator,
            reading=reading,
            value=self.description,
            unit="-",
            aim="",
            injections=(injection,),
        )


def _common_prefix_length(first: str, second: str) -> int:
    same = 0
    while same < min(len(first), len(second)) and first[same] == second[same]:
        same += 1
    return same


def _abbreviate(text: str, before: int, after: int) -> str:
    part = text[before : len(text) - after]
    half = _MOST_CHARACTERS // 2
    # the ` .. ` in the middle takes four characters
    if len(part) > _MOST_CHARACTERS + 4:
        part = f"{part[:half]} .. {part[-half:]}"
    return f"{'.. ' if before else ''}{part}{' ..' if after else ''}"
