"""A campaign file's selection of operator mutants."""

from dataclasses import dataclass
from enum import StrEnum


class MutantActivity(StrEnum):
    """When a mutant of an operator is active."""

    PERMANENT = "permanent"  # from the time at which triggers are armed, to the end
    TRANSIENT = "transient"  # as the campaign's triggers and methods specify


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorSelection:
    """Which operator mutants to take: operators, places, number and activation."""

    operators: tuple[str, ...]
    places: tuple[str, ...]
    sample_size: int | None  # number of mutants; None: all
    activities: tuple[MutantActivity, ...]
