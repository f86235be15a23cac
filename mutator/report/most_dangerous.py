"""The most dangerous results: the worst experiments, and the fault types with the most hazards."""

from collections.abc import Iterable, Mapping, Sequence
from math import isnan
from typing import Any

import pandas as pd

from mutator.report.answer_parts import (
    Answer,
    Cell,
    Codes,
    Link,
    Listing,
    bar,
    by_kind,
    kind_link,
    share,
    to_list,
)
from mutator.targets.target_facts import MetricFacts

WORST = 10  # maximum number of experiments listed as most dangerous
CONTACTS = 6  # maximum number with contact among them, if there are also hazards without contact
TYPES = 6  # maximum number of fault types listed
MARGIN = "margin_"  # prefix of the columns of hazard margins
SEVERITY = "severity"  # column with S0 to S3, or '' without contact
HAZARD = {"outcome": ["hazard"]}  # filter for the list of experiments
NO_CONTACT = "no contact"  # the page filter's name for an empty severity


def dangerous(frame: pd.DataFrame, metrics: Sequence[MetricFacts], *, has_alerts: bool) -> Answer:
    active = frame[frame["is_activated"]]
    ranked = frame[frame["outcome"] == "hazard"].sort_values("place")
    contact = contact_measure(frame)
    says = f"{share(len(ranked), len(active), 'activated faults')} led to a hazard."
    if SEVERITY in frame and len(ranked):
        says = f"{says.removesuffix('.')}: {_classes(ranked)}."
    elif contact:
        hits = int((ranked[contact] > 0).sum())
        says += f" {share(hits, len(ranked), 'hazards')} involved contact."
    units = {metric.name: metric.unit for metric in metrics}
    kinds = by_kind(ranked, active)
    came = [kind for kind in kinds if kind[1]]
    lines = [(kind_link(kind, outcome=["hazard"]), bar(part, of)) for kind, part, of in came[:TYPES]]
    first = f"top {TYPES} of {len(came)}" if len(came) > TYPES else "most hazards first"
    heads = (f"fault types with hazards, {first}", "hazards / activated")
    return Answer(
        name="dangerous",
        title="What is dangerous",
        wide=True,
        says="No fault was activated." if active.empty else says,
        listings=(*_worst_lists(ranked, units, has_alerts=has_alerts), Listing(heads=heads, lines=lines)),
        links=_links(ranked),
    )


def worst_of(frame: pd.DataFrame) -> list[str]:
    """Ids of the experiments that `dangerous` can list, sorted by `place`."""
    hazards = frame[frame["outcome"] == "hazard"]
    groups = [hazards]
    if SEVERITY in frame:
        groups = [hazards[hazards[SEVERITY] != ""], hazards[hazards[SEVERITY] == ""]]
    return [str(name) for group in groups for name in group.nsmallest(WORST, "place")["experiment_id"]]


def _links(ranked: pd.DataFrame) -> tuple[Link, ...]:
    if ranked.empty:
        return ()
    made = [Link(f"All {len(ranked):,} hazards", to_list(HAZARD, "rank"))]
    classes = sorted(filter(None, ranked[SEVERITY].unique())) if SEVERITY in ranked else []
    if classes and (ranked[SEVERITY] == "").any():
        made.append(Link("With contact", to_list({**HAZARD, SEVERITY: classes}, "rank")))
        made.append(Link("Without contact", to_list({**HAZARD, SEVERITY: [NO_CONTACT]}, "rank")))
    return tuple(made)


def contact_measure(frame: pd.DataFrame) -> str:
    """Return the column that measures a contact: delta-v, contact speed; '' if the target has neither."""
    return next((name for name in ("delta_v", "contact_speed") if name in frame), "")


def _classes(hazards: pd.DataFrame) -> str:
    """`2 of severity S3, 4 of severity S1, 14 without contact`."""
    counts = hazards[SEVERITY].value_counts()
    told = [f"{counts[name]} of severity {name}" for name in sorted(filter(None, counts.index), reverse=True)]
    return ", ".join((*told, f"{counts.get('', 0)} without contact"))


def _worst_lists(ranked: pd.DataFrame, units: Mapping[str, str], *, has_alerts: bool) -> tuple[Listing, ...]:
    """Return the worst hazards in one list, or in two if only some have a severity class: the others, which
    rank by margin, would rarely appear in a common list.
    """
    hit = ranked[ranked[SEVERITY] != ""] if SEVERITY in ranked else ranked
    missed = ranked.drop(hit.index)
    if hit.empty or missed.empty:
        return (_worst(ranked.head(WORST), "worst", HAZARD, units, has_alerts=has_alerts),)
    contacts = hit.head(max(CONTACTS, WORST - len(missed)))
    others = missed.head(WORST - len(contacts))
    classes = sorted(hit[SEVERITY].unique())
    shown, also = {**HAZARD, SEVERITY: classes}, {**HAZARD, SEVERITY: [NO_CONTACT]}
    return (
        _worst(contacts, "worst with contact", shown, units, has_alerts=has_alerts),
        _worst(others, "worst without contact", also, units, has_alerts=has_alerts),
    )


def _worst(
    ranked: pd.DataFrame,
    head: str,
    shown: Mapping[str, Sequence[str]],
    units: Mapping[str, str],
    *,
    has_alerts: bool,
) -> Listing:
    """Return the experiments with their measures of danger. Each link opens one of them in the list filtered
    by `shown`.
    """
    contact = contact_measure(ranked)
    heads = [head, "scenario", "hazards"]
    columns: list[Iterable[Cell]] = [ranked["scenario"], map(Codes, ranked["hazard_names"])]
    if SEVERITY in ranked and (ranked[SEVERITY] != "").any():
        heads.append("severity")
        columns.append(Codes((name,), "severity") if name else "-" for name in ranked[SEVERITY])
    if contact or any(name.startswith(MARGIN) for name in units):
        heads.append("measure")
        columns.append(_how_bad(row, contact, units) for row in ranked.to_dict("records"))
    heads.append("time to hazard")
    columns.append((ranked["t_hazard"] - ranked["t_activation"]).map("{:.2f} s".format))
    if has_alerts:
        heads.append("alert before hazard")
        columns.append(ranked["warned"])
    around = to_list(shown, "rank")
    links = [
        Link(fault, f"e={name}&{around}")
        for fault, name in zip(ranked["fault"], ranked["experiment_id"], strict=True)
    ]
    return Listing(heads=tuple(heads), lines=list(zip(links, *columns, strict=True)))


def _how_bad(row: Mapping[Any, Any], contact: str, units: Mapping[str, str]) -> str:
    """For a contact, its speed, for example `delta-v 6.70 m/s`; otherwise the smallest margin to hazards that
    occurred, or `-`.
    """
    if contact and row[contact] and not isnan(row[contact]):
        words = "delta-v" if contact == "delta_v" else "contact at"
        return f"{words} {row[contact]:.2f} {units.get(contact, '')}"
    margins = [(margin, units[f"{MARGIN}{name.lower()}"]) for name, margin in row["margins"]]
    return "margin {:.2f} {}".format(*min(margins)) if margins else "-"
