"""The parts of a report's answers: sentences, small tables, links into the list of experiments; and which
hazards came with a warning, or were *silent*.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from urllib.parse import quote

import numpy as np
import pandas as pd

from mutator.results.outcome_counting import hazard_times

FIRST = "alert before the hazard"
NO_ALERT, LATE = "no alert at all", "alert only after the hazard"
SILENT = (NO_ALERT, LATE)  # silent hazards: no alert before the hazard


@dataclass(frozen=True, slots=True)
class Link:
    """A text that links to a place on the page. `to` is the URL fragment, without #."""

    text: str
    to: str


@dataclass(frozen=True, slots=True)
class Part:
    """A bar that shows `part` as a share of `of`."""

    part: float
    of: float
    text: str


@dataclass(frozen=True, slots=True)
class Codes:
    """Codes of hazards or of a severity class, whose meanings the page explains. `word` precedes them."""

    names: tuple[str, ...]
    word: str = ""

    @property
    def text(self) -> str:
        return f"{self.word} {', '.join(self.names)}".lstrip()


Cell = str | Link | Part | Codes


@dataclass(frozen=True, slots=True, kw_only=True)
class Listing:
    """A small table."""

    heads: tuple[str, ...]
    lines: Sequence[tuple[Cell, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """The answer to a question. `wide`: its tables have many columns."""

    name: str
    title: str
    says: str
    listings: tuple[Listing, ...] = ()  # listings without lines are not shown
    links: tuple[Link, ...] = ()
    wide: bool = False


def to_list(facets: Mapping[str, Sequence[str]], sort: str = "") -> str:
    """Return the URL fragment that opens the list of experiments with these filters."""
    parts = [f"{name}={','.join(quote(v, safe='') for v in values)}" for name, values in facets.items()]
    return "&".join((*parts, *([f"sort={sort}"] if sort else ())))


def share(part: int, of: int, what: str) -> str:
    """Return a share as text, for example `20 of 96 activated faults (21 %)`."""
    noun = what.removesuffix("s") if of == 1 else what
    return f"{part:,} of {of:,} {noun}" + (f" ({100 * part / of:.0f} %)" if of else "")


def were(count: int) -> str:
    return "was" if count == 1 else "were"


def by_kind(part: pd.DataFrame, of: pd.DataFrame) -> list[tuple[str, int, int]]:
    """Each fault type with its number of rows in `part` and in `of`, largest first."""
    parts = part["kind"].value_counts()
    counts = [(str(k), int(parts.get(k, 0)), int(n)) for k, n in of["kind"].value_counts().items()]
    return sorted(counts, key=lambda c: (-c[1], -c[2], c[0]))


def kind_link(kind: str, **facets: Sequence[str]) -> Link:
    return Link(kind, to_list({"kind": [kind], **facets}))


def bar(part: int, of: int) -> Part:
    return Part(part, of, f"{part:,} of {of:,}")


def warnings_of(frame: pd.DataFrame) -> np.ndarray:
    """Return the value of the page's filter `warning` for each row of a frame of results; '' without a
    hazard.
    """
    late = np.where(frame["reaction_time"].isna(), LATE, FIRST)
    hazard = np.where(frame["alerts"] == "", NO_ALERT, late)
    return np.where(hazard_times(frame).notna().any(axis=1), hazard, "")
