"""STPA as data: hazards and context tables, from which the guided triggers come."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from mutator.model import Hold, Trigger


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdicts:
    """For one control action in one context: the hazard if it is given, and if it is not (None: none)."""

    provided: str | None
    not_provided: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ContextRow:
    """A context: its id (`C1`), its condition over observed variables with the constants put in, and for
    each control action whether giving it or not giving it is hazardous."""

    id: str
    condition: str
    about: str
    actions: Mapping[str, Verdicts]


@dataclass(frozen=True, kw_only=True)
class ContextTable:
    """A context table of the hazard analysis."""

    name: str
    path: Path
    constants: Mapping[str, float]
    rows: tuple[ContextRow, ...]

    def triggers(
        self, *, hold: Hold = Hold.WHILE, armed_after_s: float = 0.0, rows: tuple[str, ...] | None = None
    ) -> tuple[Trigger, ...]:
        """One trigger per row (or row named in `rows`), named as the row; MutatorError for an unknown row."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class HazardList:
    """Accidents and hazards: id -> description; hazards also name the accidents they may lead to."""

    path: Path
    accidents: Mapping[str, str]
    hazards: Mapping[str, str]
    leads_to: Mapping[str, tuple[str, ...]]


def load_context_table(path: Path) -> ContextTable:
    """Read a context table; every condition is checked as a trigger condition."""
    raise NotImplementedError


def load_hazards(path: Path) -> HazardList:
    """Read the accidents and hazards; a hazard that leads to an unknown accident is an error."""
    raise NotImplementedError
