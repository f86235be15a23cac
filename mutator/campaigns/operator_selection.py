"""A campaign file's selection of operator mutants."""

from dataclasses import dataclass
from enum import StrEnum

from mutator.operators.names import Operator


class When(StrEnum):
    """When a mutant of an operator is active."""

    PERMANENT = "permanent"  # from when triggers are armed to the end
    TRANSIENT = "transient"  # as the campaign's triggers and methods say


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorSelection:
    """Mutants of operators in places of the source; `sample` is how many (None: all)."""

    operators: tuple[Operator, ...]
    places: tuple[str, ...]
    sample: int | None
    when: tuple[When, ...]
