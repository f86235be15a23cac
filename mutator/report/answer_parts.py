"""The parts of a report's answers: sentences, small tables, links into the list of experiments; and which
hazards came with a warning, or were *silent*.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING
from urllib.parse import quote

import numpy as np

from mutator._common.message_text import rounded_percent
from mutator.results.outcome_counting import first_hazard_times

if TYPE_CHECKING:
    import pandas as pd

ALERT_BEFORE_HAZARD = "alert before the hazard"
NO_ALERT, ALERT_AFTER_HAZARD = "no alert at all", "alert only after the hazard"
SILENT_HAZARD_WARNINGS = (NO_ALERT, ALERT_AFTER_HAZARD)  # silent hazards: no alert before the hazard


@dataclass(frozen=True, slots=True)
class PageLink:
    """A text that links to a place on the page. `fragment` is that of the URL, without #. `note` stands below
    the link.
    """

    text: str
    fragment: str
    note: str = ""


@dataclass(frozen=True, slots=True)
class ShareBar:
    """A bar that shows `part` as a share of `whole`."""

    part: float
    whole: float
    text: str


@dataclass(frozen=True, slots=True)
class ExplainedCodes:
    """Codes of hazards or of a severity class, whose meanings the page explains. `prefix` precedes them, and
    `label` replaces them.
    """

    codes: tuple[str, ...]
    prefix: str = ""
    label: str = ""

    @property
    def text(self) -> str:
        return f"{self.prefix} {self.label or ', '.join(self.codes)}".lstrip()


AnswerCell = str | PageLink | ShareBar | ExplainedCodes


@dataclass(frozen=True, slots=True, kw_only=True)
class AnswerTable:
    """A small table in an answer: heads and rows, without a title."""

    heads: tuple[str, ...]
    rows: Sequence[tuple[AnswerCell, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportAnswer:
    """The answer to a question. `has_wide_tables`: they have many columns."""

    html_name: str
    title: str
    paragraph: str
    tables: tuple[AnswerTable, ...] = ()  # tables without rows are not shown
    links: tuple[PageLink, ...] = ()
    has_wide_tables: bool = False


def filtered_list_fragment(filters: Mapping[str, Sequence[str]], sort: str = "") -> str:
    """Return the URL fragment that opens the list of experiments with these filters."""
    parts = [f"{name}={','.join(quote(v, safe='') for v in values)}" for name, values in filters.items()]
    return "&".join((*parts, *([f"sort={sort}"] if sort else ())))


def describe_share(part: int, whole: int, plural_noun: str, *, is_sample: bool = False) -> str:
    """Return a share as text, for example `20 of 96 activated faults (21 %)`; of a sample only the counts,
    because they have no rate of all.
    """
    noun = plural_noun.removesuffix("s") if whole == 1 else plural_noun
    percent = f" ({rounded_percent(part, whole)} %)" if whole and not is_sample else ""
    return f"{part:,} of {whole:,} {noun}{percent}"


def was_or_were(count: int) -> str:
    return "was" if count == 1 else "were"


def fault_type_counts(part: "pd.DataFrame", whole: "pd.DataFrame") -> list[tuple[str, int, int]]:
    """Each fault type with its number of rows in `part` and in `whole`, largest first."""
    parts = part["kind"].value_counts()
    counts = [(str(k), int(parts.get(k, 0)), int(n)) for k, n in whole["kind"].value_counts().items()]
    return sorted(counts, key=lambda c: (-c[1], -c[2], c[0]))


def fault_type_link(fault_type: str, **filters: Sequence[str]) -> PageLink:
    return PageLink(fault_type, filtered_list_fragment({"kind": [fault_type], **filters}))


def share_bar(part: int, whole: int) -> ShareBar:
    return ShareBar(part, whole, f"{part:,} of {whole:,}")


def warning_filter_values(frame: "pd.DataFrame") -> np.ndarray:
    """Return the value of the page's filter `warning` for each row of a frame of results; '' without a
    hazard.
    """
    late = np.where(frame["reaction_time"].isna(), ALERT_AFTER_HAZARD, ALERT_BEFORE_HAZARD)
    hazard = np.where(frame["alerts"] == "", NO_ALERT, late)
    return np.where(first_hazard_times(frame).notna().any(axis=1), hazard, "")
