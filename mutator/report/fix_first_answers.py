"""Answers which fault types to fix first, and which component lets them through."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from math import inf
from typing import TYPE_CHECKING

from mutator.outcomes.fault_paths import UntimedPath
from mutator.report.answer_parts import (
    ALERT_BEFORE_HAZARD,
    SILENT_HAZARD_WARNINGS,
    AnswerCell,
    AnswerTable,
    PageLink,
    ReportAnswer,
    describe_share,
    fault_type_link,
    filtered_list_fragment,
)
from mutator.report.fault_path_page_data import RunFaultPaths, link_name
from mutator.report.most_dangerous_experiments_answer import NO_CLASS_VALUE, SEVERITY_COLUMN
from mutator.statistics.sample_weights import WEIGHT_COLUMN

if TYPE_CHECKING:
    import pandas as pd

MOST_FAULT_TYPES = 5  # maximum number of fault types listed


def fix_first_answer(
    frame: "pd.DataFrame",
    paths: RunFaultPaths | None,
    severity_labels: Mapping[str, str],
    *,
    has_alerts: bool,
) -> ReportAnswer:
    """Say which fault types to fix first: those with the most silent hazards in the highest severity
    class; ties are broken by the next lower classes, then by hazards without a class, then by the shortest
    time from activation to hazard. If the target has no alerts, all hazards are counted. `frame` must have at
    least one hazard.
    """
    hazards = frame[frame["outcome"] == "hazard"]
    counted_hazards = hazards[hazards["warning"] != ALERT_BEFORE_HAZARD] if has_alerts else hazards
    if counted_hazards.empty:  # all hazards came after an alert, so count all
        counted_hazards, has_alerts = hazards, False
    classes = _severity_classes(counted_hazards)
    order = _fault_types_in_order(counted_hazards, classes)
    plural_noun = "silent hazards" if has_alerts else "hazards"
    heads = [
        "fault type",
        f"{plural_noun} by severity" if SEVERITY_COLUMN in counted_hazards else plural_noun,
        "shortest time to hazard",
    ]
    heads += ["passed on to an actuator by", "stopped by, of all active"] if paths else []
    list_filter: Mapping[str, Sequence[str]] = (
        {"warning": SILENT_HAZARD_WARNINGS} if has_alerts else {"outcome": ["hazard"]}
    )
    rows = [
        _fault_type_row(
            kind,
            frame[frame["kind"] == kind],
            counted_hazards[counted_hazards["kind"] == kind],
            classes,
            severity_labels,
            list_filter,
            paths,
        )
        for kind in order[:MOST_FAULT_TYPES]
    ]
    return ReportAnswer(
        html_name="first",
        title="What to fix first",
        has_wide_tables=True,
        paragraph=_rule_paragraph(order, counted_hazards, classes, severity_labels, plural_noun),
        tables=(AnswerTable(heads=tuple(heads), rows=rows),),
    )


def _severity_classes(hazards: "pd.DataFrame") -> list[str]:
    """Return the severity classes that occur, highest first; no class ('') is last."""
    return sorted(hazards[SEVERITY_COLUMN].unique(), reverse=True) if SEVERITY_COLUMN in hazards else [""]


def _hazards_of_class(hazards: "pd.DataFrame", name: str) -> "pd.DataFrame":
    return hazards[hazards[SEVERITY_COLUMN] == name] if SEVERITY_COLUMN in hazards else hazards


def _times_to_hazard(hazards: "pd.DataFrame") -> "pd.Series":
    """Return the times from activation to hazard, s."""
    return hazards["t_hazard"] - hazards["t_activation"]


def _fault_types_in_order(hazards: "pd.DataFrame", classes: Sequence[str]) -> list[str]:
    groups = {str(kind): group for kind, group in hazards.groupby("kind")}
    key = {
        kind: (
            *(-len(_hazards_of_class(group, name)) for name in classes),
            float(_times_to_hazard(group).min()),
            kind,
        )
        for kind, group in groups.items()
    }
    return sorted(groups, key=key.__getitem__)


def _rule_paragraph(
    order: Sequence[str],
    counted_hazards: "pd.DataFrame",
    classes: Sequence[str],
    severity_labels: Mapping[str, str],
    plural_noun: str,
) -> str:
    is_first_type = counted_hazards["kind"] == order[0]
    share_text = partial(describe_share, is_sample=WEIGHT_COLUMN in counted_hazards)
    first_share = share_text(int(is_first_type.sum()), len(counted_hazards), plural_noun)
    paragraph = f"Start with {order[0]}: {first_share}"
    if classes[0]:
        of_class = counted_hazards[SEVERITY_COLUMN] == classes[0]
        part, all_ = int((is_first_type & of_class).sum()), int(of_class.sum())
        paragraph += f", and {'the only one that is' if all_ == 1 else f'{part} of {all_} that are'} "
        paragraph += severity_labels.get(classes[0], f"of severity {classes[0]}")
        paragraph += f", the highest among the {plural_noun}"
    paragraph += f". The rule: fault types with the most {plural_noun}"
    if len(classes) > 1:
        paragraph += " of the highest severity come first; ties are broken by the next lower class, then by"
    else:
        paragraph += " come first; ties are broken by"
    paragraph += " the shortest time from fault to hazard."
    if len(order) > MOST_FAULT_TYPES:
        paragraph += f" The table shows the first {MOST_FAULT_TYPES} of {len(order)} fault types."
    return paragraph


def _fault_type_row(
    kind: str,
    results_of_type: "pd.DataFrame",
    counted_hazards: "pd.DataFrame",
    classes: Sequence[str],
    severity_labels: Mapping[str, str],
    list_filter: Mapping[str, Sequence[str]],
    paths: RunFaultPaths | None,
) -> tuple[AnswerCell, ...]:
    counts_by_class = [(name, len(_hazards_of_class(counted_hazards, name))) for name in classes]
    if SEVERITY_COLUMN in counted_hazards:
        named = [
            f"{n} {severity_labels.get(name, f'of severity {name}')}" if name else f"{n} without a class"
            for name, n in counts_by_class
            if n
        ]
        numbers = ", ".join(named)
    else:
        numbers = f"{len(counted_hazards):,}"
    times_to_hazard = _times_to_hazard(counted_hazards)
    fastest = str(counted_hazards["experiment_id"].iloc[int(times_to_hazard.fillna(inf).argmin())])
    worst = next((name for name, n in counts_by_class if n), "")
    filters = {"kind": [kind], **list_filter}
    severe = {SEVERITY_COLUMN: [worst or NO_CLASS_VALUE]} if SEVERITY_COLUMN in counted_hazards else {}
    row: list[AnswerCell] = [
        fault_type_link(kind, **list_filter),
        PageLink(numbers, filtered_list_fragment({**filters, **severe}, "rank")),
        PageLink(f"{times_to_hazard.min():.2f} s", f"e={fastest}&{filtered_list_fragment(filters, 'rank')}"),
    ]
    if paths:
        active = results_of_type[results_of_type["is_activated"]]
        row += [
            _component_that_passed_most(kind, counted_hazards, list_filter, paths),
            _component_that_stopped_most(kind, active, paths),
        ]
    return tuple(row)


def _component_that_passed_most(
    kind: str, hazards: "pd.DataFrame", list_filter: Mapping[str, Sequence[str]], paths: RunFaultPaths
) -> AnswerCell:
    """Return the component that most often let this fault type through to the first changed actuator."""
    passed: Counter[str] = Counter()
    links: dict[str, set[str]] = {}
    for untimed_path, count in _untimed_path_counts(hazards, paths):
        if link := untimed_path.link_to_first_actuator:
            passed[link.tail] += count
            links.setdefault(link.tail, set()).add(link_name(link.tail, link.tip))
    if not passed:
        return "-"
    component = min(passed, key=lambda name: (-passed[name], name))
    fragment = filtered_list_fragment(
        {"kind": [kind], **list_filter, "through": sorted(links[component])}, "rank"
    )
    return PageLink(f"{paths.component_label(component)}: {passed[component]} of {len(hazards)}", fragment)


def _untimed_path_counts(frame: "pd.DataFrame", paths: RunFaultPaths) -> Iterator[tuple[UntimedPath, int]]:
    for code, count in frame["untimed_path"].value_counts(sort=False).items():
        if (place := int(str(code))) >= 0:
            yield paths.distinct_untimed_paths[place], int(count)


def _component_that_stopped_most(kind: str, active: "pd.DataFrame", paths: RunFaultPaths) -> AnswerCell:
    """Return the component that stopped most faults of this type, a candidate for stopping the rest."""
    stopped: Counter[str] = Counter()
    for untimed_path, count in _untimed_path_counts(active, paths):
        for name in untimed_path.stopped_at:
            stopped[name] += count
    if not stopped:
        return f"none of {len(active):,}"
    component = min(stopped, key=lambda name: (-stopped[name], name))
    text = f"{paths.component_label(component)}: {stopped[component]:,} of {len(active):,}"
    return PageLink(text, filtered_list_fragment({"kind": [kind], "stopped_at": [component]}))
