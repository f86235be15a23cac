"""The most dangerous results: the worst experiments, and the fault types with the most hazards."""

from collections.abc import Iterable, Mapping, Sequence
from math import isnan
from typing import Any

import pandas as pd

from mutator.report.answer_parts import (
    AnswerCell,
    AnswerTable,
    ExplainedCodes,
    PageLink,
    ReportAnswer,
    describe_share,
    fault_type_counts,
    fault_type_link,
    filtered_list_fragment,
    share_bar,
)
from mutator.targets.stored_target_facts import MetricFacts

MOST_LISTED = 10  # maximum number of experiments listed as most dangerous
MOST_LISTED_CONTACTS = 6  # maximum number with contact among them, if there are also hazards without contact
MOST_FAULT_TYPES = 6  # maximum number of fault types listed
MARGIN_PREFIX = "margin_"  # prefix of the columns of hazard margins
SEVERITY_COLUMN = "severity"  # column with S0 to S3, or '' without contact
HAZARD_FILTER = {"outcome": ["hazard"]}  # filter for the list of experiments
NO_CONTACT_VALUE = "no contact"  # the page filter's name for an empty severity


def most_dangerous_answer(
    frame: pd.DataFrame,
    metrics: Sequence[MetricFacts],
    severity_labels: Mapping[str, str],
    *,
    has_alerts: bool,
) -> ReportAnswer:
    active = frame[frame["is_activated"]]
    ranked = frame[frame["outcome"] == "hazard"].sort_values("place")
    contact_column = find_contact_column(frame)
    paragraph = f"{describe_share(len(ranked), len(active), 'activated faults')} led to a hazard."
    if SEVERITY_COLUMN in frame and len(ranked):
        paragraph = f"{paragraph.removesuffix('.')}: {_describe_severities(ranked, severity_labels)}."
    elif contact_column:
        hits = int((ranked[contact_column] > 0).sum())
        paragraph += f" {describe_share(hits, len(ranked), 'hazards')} involved contact."
    units = {metric.name: metric.unit for metric in metrics}
    kinds = fault_type_counts(ranked, active)
    with_hazards = [kind for kind in kinds if kind[1]]
    rows = [
        (fault_type_link(kind, outcome=["hazard"]), share_bar(part, of))
        for kind, part, of in with_hazards[:MOST_FAULT_TYPES]
    ]
    first = (
        f"top {MOST_FAULT_TYPES} of {len(with_hazards)}"
        if len(with_hazards) > MOST_FAULT_TYPES
        else "most hazards first"
    )
    heads = (f"fault types with hazards, {first}", "hazards / activated")
    return ReportAnswer(
        html_name="dangerous",
        title="What is dangerous",
        has_wide_tables=True,
        paragraph="No fault was activated." if active.empty else paragraph,
        tables=(
            *_worst_tables(ranked, units, severity_labels, has_alerts=has_alerts),
            AnswerTable(heads=heads, rows=rows),
        ),
        links=_list_links(ranked),
    )


def worst_hazard_ids(frame: pd.DataFrame) -> list[str]:
    """Ids of the experiments that `dangerous` can list, sorted by `place`."""
    hazards = frame[frame["outcome"] == "hazard"]
    groups = [hazards]
    if SEVERITY_COLUMN in frame:
        groups = [hazards[hazards[SEVERITY_COLUMN] != ""], hazards[hazards[SEVERITY_COLUMN] == ""]]
    return [str(name) for group in groups for name in group.nsmallest(MOST_LISTED, "place")["experiment_id"]]


def _list_links(ranked: pd.DataFrame) -> tuple[PageLink, ...]:
    if ranked.empty:
        return ()
    links = [PageLink(f"All {len(ranked):,} hazards", filtered_list_fragment(HAZARD_FILTER, "rank"))]
    classes = sorted(filter(None, ranked[SEVERITY_COLUMN].unique())) if SEVERITY_COLUMN in ranked else []
    if classes and (ranked[SEVERITY_COLUMN] == "").any():
        links.append(
            PageLink(
                "With contact", filtered_list_fragment({**HAZARD_FILTER, SEVERITY_COLUMN: classes}, "rank")
            )
        )
        links.append(
            PageLink(
                "Without contact",
                filtered_list_fragment({**HAZARD_FILTER, SEVERITY_COLUMN: [NO_CONTACT_VALUE]}, "rank"),
            )
        )
    return tuple(links)


def find_contact_column(frame: pd.DataFrame) -> str:
    """Return the column that measures a contact: delta-v, contact speed; '' if the target has neither."""
    return next((name for name in ("delta_v", "contact_speed") if name in frame), "")


def _describe_severities(hazards: pd.DataFrame, labels: Mapping[str, str]) -> str:
    """`2 of severity S3 possibly fatal, 4 of severity S1 light, 14 without contact`."""
    counts = hazards[SEVERITY_COLUMN].value_counts()
    parts = [
        f"{counts[name]} of severity {labels.get(name, name)}"
        for name in sorted(filter(None, counts.index), reverse=True)
    ]
    return ", ".join((*parts, f"{counts.get('', 0)} without contact"))


def _worst_tables(
    ranked: pd.DataFrame, units: Mapping[str, str], severity_labels: Mapping[str, str], *, has_alerts: bool
) -> tuple[AnswerTable, ...]:
    """Return the worst hazards in one list, or in two if only some have a severity class: the others, which
    rank by margin, would rarely appear in a common list.
    """
    with_contact = ranked[ranked[SEVERITY_COLUMN] != ""] if SEVERITY_COLUMN in ranked else ranked
    without_contact = ranked.drop(with_contact.index)
    if with_contact.empty or without_contact.empty:
        return (
            _worst_table(
                ranked.head(MOST_LISTED),
                "worst",
                HAZARD_FILTER,
                units,
                severity_labels,
                has_alerts=has_alerts,
            ),
        )
    contacts = with_contact.head(max(MOST_LISTED_CONTACTS, MOST_LISTED - len(without_contact)))
    others = without_contact.head(MOST_LISTED - len(contacts))
    classes = sorted(with_contact[SEVERITY_COLUMN].unique())
    contact_filter, no_contact_filter = (
        {**HAZARD_FILTER, SEVERITY_COLUMN: classes},
        {**HAZARD_FILTER, SEVERITY_COLUMN: [NO_CONTACT_VALUE]},
    )
    return (
        _worst_table(
            contacts, "worst with contact", contact_filter, units, severity_labels, has_alerts=has_alerts
        ),
        _worst_table(
            others, "worst without contact", no_contact_filter, units, severity_labels, has_alerts=has_alerts
        ),
    )


def _worst_table(
    ranked: pd.DataFrame,
    first_head: str,
    list_filter: Mapping[str, Sequence[str]],
    units: Mapping[str, str],
    severity_labels: Mapping[str, str],
    *,
    has_alerts: bool,
) -> AnswerTable:
    """Return the experiments with their measures of danger. Each link opens one of them in the list filtered
    by `list_filter`.
    """
    contact_column = find_contact_column(ranked)
    heads = [first_head, "scenario", "hazards"]
    columns: list[Iterable[AnswerCell]] = [ranked["scenario"], map(ExplainedCodes, ranked["hazard_names"])]
    if SEVERITY_COLUMN in ranked and (ranked[SEVERITY_COLUMN] != "").any():
        heads.append("severity")
        columns.append(
            ExplainedCodes((name,), "severity", severity_labels.get(name, "")) if name else "-"
            for name in ranked[SEVERITY_COLUMN]
        )
    if contact_column or any(name.startswith(MARGIN_PREFIX) for name in units):
        heads.append("measure")
        columns.append(_describe_danger(row, contact_column, units) for row in ranked.to_dict("records"))
    heads.append("time to hazard")
    columns.append((ranked["t_hazard"] - ranked["t_activation"]).map("{:.2f} s".format))
    if has_alerts:
        heads.append("alert before hazard")
        columns.append(ranked["warned"])
    filtered_list = filtered_list_fragment(list_filter, "rank")
    links = [
        PageLink(fault, f"e={name}&{filtered_list}")
        for fault, name in zip(ranked["fault"], ranked["experiment_id"], strict=True)
    ]
    return AnswerTable(heads=tuple(heads), rows=list(zip(links, *columns, strict=True)))


def _describe_danger(row: Mapping[Any, Any], contact_column: str, units: Mapping[str, str]) -> str:
    """For a contact, its speed, for example `delta-v 6.70 m/s`; otherwise the smallest margin to hazards that
    occurred, or `-`.
    """
    if contact_column and row[contact_column] and not isnan(row[contact_column]):
        words = "delta-v" if contact_column == "delta_v" else "contact at"
        return f"{words} {row[contact_column]:.2f} {units.get(contact_column, '')}"
    margins = [(margin, units[f"{MARGIN_PREFIX}{name.lower()}"]) for name, margin in row["margins"]]
    return "margin {:.2f} {}".format(*min(margins)) if margins else "-"
