"""The most dangerous results: the worst experiments, and the fault types with the most hazards."""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from math import isnan
from typing import TYPE_CHECKING, Any

from mutator._common.phrase_texts import measured_number_text
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
from mutator.results.worst_first_ranking import causes_of, worst_of_each_cause
from mutator.statistics.sample_weights import WEIGHT_COLUMN
from mutator.targets.stored_target_facts import MetricFacts

if TYPE_CHECKING:
    import pandas as pd

MOST_LISTED = 10  # maximum number of causes listed as most dangerous
MOST_FAULT_TYPES = 6  # maximum number of fault types listed
MARGIN_PREFIX = "margin_"  # prefix of the columns of hazard margins
SEVERITY_COLUMN = "severity"  # column with S0 to S3, or '' without a class
HAZARD_FILTER = {"outcome": ["hazard"]}  # filter for the list of experiments
NO_CLASS_VALUE = "no class"  # the page filter's name for an empty severity


def most_dangerous_answer(
    frame: "pd.DataFrame",
    metrics: Sequence[MetricFacts],
    severity_labels: Mapping[str, str],
    *,
    has_alerts: bool,
) -> ReportAnswer:
    active = frame[frame["is_activated"]]
    share_text = partial(describe_share, is_sample=WEIGHT_COLUMN in frame)
    ranked = frame[frame["outcome"] == "hazard"].sort_values("place")
    contact_column = find_contact_column(frame)
    paragraph = f"{share_text(len(ranked), len(active), 'activated faults')} led to a hazard."
    if SEVERITY_COLUMN in frame and len(ranked):
        paragraph = f"{paragraph.removesuffix('.')}: {_describe_severities(ranked, severity_labels)}."
    elif contact_column:
        hits = int((ranked[contact_column] > 0).sum())
        paragraph += f" {share_text(hits, len(ranked), 'hazards')} involved contact."
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
            _worst_table(ranked, units, severity_labels, has_alerts=has_alerts),
            AnswerTable(heads=heads, rows=rows),
        ),
        links=_list_links(ranked),
    )


def worst_hazard_ids(frame: "pd.DataFrame") -> list[str]:
    """Ids of the experiments that `dangerous` can list, sorted by `place`."""
    ranked = frame[frame["outcome"] == "hazard"].sort_values("place")
    return [str(name) for name in worst_of_each_cause(ranked)[0]["experiment_id"].head(MOST_LISTED)]


def _list_links(ranked: "pd.DataFrame") -> tuple[PageLink, ...]:
    if ranked.empty:
        return ()
    links = [PageLink(f"All {len(ranked):,} hazards", filtered_list_fragment(HAZARD_FILTER, "rank"))]
    classes = sorted(filter(None, ranked[SEVERITY_COLUMN].unique())) if SEVERITY_COLUMN in ranked else []
    if classes and (ranked[SEVERITY_COLUMN] == "").any():
        links.append(
            PageLink(
                "With a class", filtered_list_fragment({**HAZARD_FILTER, SEVERITY_COLUMN: classes}, "rank")
            )
        )
        links.append(
            PageLink(
                "Without a class",
                filtered_list_fragment({**HAZARD_FILTER, SEVERITY_COLUMN: [NO_CLASS_VALUE]}, "rank"),
            )
        )
    return tuple(links)


def find_contact_column(frame: "pd.DataFrame") -> str:
    """Return the column that measures a contact: delta-v, contact speed; '' if the target has neither."""
    return next((name for name in ("delta_v", "contact_speed") if name in frame), "")


def _describe_severities(hazards: "pd.DataFrame", labels: Mapping[str, str]) -> str:
    """`2 possibly fatal (severity S3), 4 light (severity S1), 14 without a class`."""
    counts = hazards[SEVERITY_COLUMN].value_counts()
    parts = [
        f"{counts[name]} {labels.get(name, f'of severity {name}')}"
        for name in sorted(filter(None, counts.index), reverse=True)
    ]
    if unclassified := counts.get("", 0):
        parts.append(f"{unclassified} without a class")
    return ", ".join(parts)


def _worst_table(
    ranked: "pd.DataFrame", units: Mapping[str, str], severity_labels: Mapping[str, str], *, has_alerts: bool
) -> AnswerTable:
    """Return the worst experiment of each cause, with its measures of danger and the number of others."""
    ranked, more = worst_of_each_cause(ranked)
    ranked = ranked.head(MOST_LISTED)
    contact_column = find_contact_column(ranked)
    filtered_list = filtered_list_fragment(HAZARD_FILTER, "rank")
    columns: dict[str, Iterable[AnswerCell]] = {}
    if SEVERITY_COLUMN in ranked and (ranked[SEVERITY_COLUMN] != "").any():
        columns["severity"] = (
            ExplainedCodes((name,), "", severity_labels.get(name, "")) if name else NO_CLASS_VALUE
            for name in ranked[SEVERITY_COLUMN]
        )
    columns["worst of each cause"] = (
        _experiment_link(row, filtered_list) for row in ranked.to_dict("records")
    )
    columns["hazards"] = map(ExplainedCodes, ranked["hazard_names"])
    if contact_column or any(name.startswith(MARGIN_PREFIX) for name in units):
        columns["measure"] = (
            _describe_danger(row, contact_column, units) for row in ranked.to_dict("records")
        )
    columns["time to hazard"] = (ranked["t_hazard"] - ranked["t_activation"]).map("{:.2f} s".format)
    if has_alerts:
        columns["alert before hazard"] = ranked["warned"]
    causes = causes_of(ranked).itertuples(index=False)
    columns["more of this cause"] = (
        PageLink(f"{count:,}", filtered_list_fragment(_filter_of_cause(*cause), "rank")) if count else "-"
        for cause, count in zip(causes, more, strict=False)
    )
    return AnswerTable(heads=tuple(columns), rows=list(zip(*columns.values(), strict=True)))


def _experiment_link(row: Mapping[Any, Any], filtered_list: str) -> PageLink:
    """Return the link to an experiment: what happened and, below, its fault with value, scenario and trigger.
    Without a sentence, the fault is the link.
    """
    place = f"in {row['scenario_label']}, trigger {row['trigger']}"
    sentence = row["sentence"]
    return PageLink(
        sentence or row["fault"],
        f"e={row['experiment_id']}&{filtered_list}",
        f"{row['fault']} {place}" if sentence else place,
    )


def _filter_of_cause(kind: str, hazard: str) -> dict[str, Sequence[str]]:
    return {"kind": [kind], **HAZARD_FILTER, "hazards": [hazard]}


def _describe_danger(row: Mapping[Any, Any], contact_column: str, units: Mapping[str, str]) -> str:
    """For a contact, its speed, for example `delta-v 6.70 m/s`; otherwise the smallest margin to hazards that
    occurred, or `-`.
    """
    if contact_column and row[contact_column] and not isnan(row[contact_column]):
        words = "delta-v" if contact_column == "delta_v" else "contact at"
        return f"{words} {measured_number_text(row[contact_column], units.get(contact_column, ''))}"
    margins = [(margin, units[f"{MARGIN_PREFIX}{name.lower()}"]) for name, margin in row["margins"]]
    return f"margin {measured_number_text(*min(margins))}" if margins else "-"
