"""What a reader asks a report first, each answered in a few numbers with their denominators.

An answer links to the list of experiments, filtered to those it speaks of.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote

import pandas as pd

from mutator._common.text import counted
from mutator.execution.phases import duration
from mutator.outcomes.ranking import worst
from mutator.outcomes.rows import Row
from mutator.report.studies import ReportedRun

WORST = 10  # experiments that are listed as the most dangerous
TYPES = 6  # fault types that an answer lists
NO_ALERT, LATE = "no alert", "alert after the hazard"  # values of the page's filter `warning`
FIRST = "alert before the hazard"
MARGIN = "margin_"  # how the columns of margins to a hazard begin
SEVERITY = "severity"  # column: S0 to S3, empty without contact


@dataclass(frozen=True, slots=True)
class Link:
    """A text that leads to a place of the page: `to` is what stands behind #."""

    text: str
    to: str


@dataclass(frozen=True, slots=True)
class Part:
    """`part` of `of`, drawn as a bar."""

    part: float
    of: float
    text: str


Cell = str | Link | Part


@dataclass(frozen=True, slots=True, kw_only=True)
class Listing:
    """A small table."""

    heads: tuple[str, ...]
    lines: Sequence[tuple[Cell, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """A question's answer: a sentence or two, tables, and links to the experiments it speaks of."""

    name: str
    title: str
    says: str
    listings: tuple[Listing, ...] = ()  # those without lines are not shown
    links: tuple[Link, ...] = ()


def answers_of(run: ReportedRun) -> tuple[Answer, ...]:
    """The answers that the results of a run can give."""
    frame = _told(run)
    has_alerts = run.folder.has_alerts
    made = [dangerous(frame, run.folder.head.get("metrics", ()), has_alerts=has_alerts)]
    if has_alerts:
        made.append(unwarned(frame))
    made.append(survived(frame))
    timings = run.folder.timings()
    if timings:
        made.append(time_spent(frame, timings))
    return tuple(made)


def _told(run: ReportedRun) -> pd.DataFrame:
    """The usable experiments with their place among the worst, and the words for fault, hazards, warning."""
    rows = {row.experiment_id: row for row in run.rows}
    shown = [rows[name] for name in run.frame["experiment_id"]]
    place = {row.experiment_id: i for i, row in enumerate(worst(run.rows))}
    return run.frame.assign(
        place=run.frame["experiment_id"].map(place),
        fault=[row.fault for row in shown],
        hazard_names=[", ".join(name for name, _ in row.hazards) for row in shown],
        warning=[warning(row) for row in shown],
        warned=[_warned(row) for row in shown],
    )


def warning(row: Row) -> str:
    """Whether a hazard came with a warning; '' without a hazard."""
    if not row.hazards:
        return ""
    if not row.alerts:
        return NO_ALERT
    return LATE if row.reaction_time is None else FIRST


def to_list(facets: Mapping[str, Sequence[str]], sort: str = "") -> str:
    """The fragment of the list with these filters."""
    parts = [f"{name}={','.join(quote(v, safe='') for v in values)}" for name, values in facets.items()]
    return "&".join((*parts, *([f"sort={sort}"] if sort else ())))


def share(part: int, of: int, what: str) -> str:
    """`20 of 96 activated faults (21 %)`; in the singular where there is but one."""
    noun = what.removesuffix("s") if of == 1 else what
    return f"{part:,} of {of:,} {noun}" + (f" ({100 * part / of:.0f} %)" if of else "")


def _warned(row: Row) -> str:
    """`fcw, 1.2 s`."""
    if row.reaction_time is None:
        return "too late" if row.alerts else "none"
    return f"{row.alerts[0]}, {row.reaction_time:.1f} s"


def dangerous(frame: pd.DataFrame, metrics: Sequence[Sequence[str]], *, has_alerts: bool) -> Answer:
    """The worst experiments, and the fault types that end in a hazard most often."""
    active = frame[frame["is_activated"]]
    ranked = frame[frame["outcome"] == "hazard"].sort_values("place")
    contact = contact_measure(frame)
    says = f"{share(len(ranked), len(active), 'activated faults')} led to a hazard."
    if SEVERITY in frame:
        says += f" By severity: {_classes(ranked)}."
    elif contact:
        hits = int((pd.to_numeric(ranked[contact]) > 0).sum())
        says += f" {share(hits, len(ranked), 'hazards')} came with contact."
    every = Link(f"All {len(ranked):,} hazards", to_list({"outcome": ["hazard"]}, "rank"))
    units = {name: unit for name, unit, *_ in metrics}
    by_kind = _by_kind(ranked, active)
    kinds = Listing(
        heads=("fault types, most hazards first", "hazards / activated"),
        lines=[
            (_kind(kind, outcome=["hazard"]), _part(part, of)) for kind, part, of in by_kind[:TYPES] if part
        ],
    )
    return Answer(
        name="dangerous",
        title="What is dangerous",
        says=says,
        listings=(_worst(ranked.head(WORST), units, has_alerts=has_alerts), kinds),
        links=(every,) if len(ranked) else (),
    )


def contact_measure(frame: pd.DataFrame) -> str:
    """The column that tells how hard a contact was, the better one first; '' if the target has none."""
    return next((name for name in ("delta_v", "contact_speed") if name in frame), "")


def _classes(hazards: pd.DataFrame) -> str:
    """`S3 2, S1 4, without contact 14`."""
    counts = hazards[SEVERITY].value_counts()
    told = [f"{name} {counts[name]}" for name in sorted(filter(None, counts.index), reverse=True)]
    return ", ".join((*told, f"without contact {counts.get('', 0)}"))


def _worst(ranked: pd.DataFrame, units: Mapping[str, str], *, has_alerts: bool) -> Listing:
    """The experiments with what tells how bad they are."""
    contact = contact_measure(ranked)
    heads = ["the worst", "scenario", "hazards"]
    columns = [ranked["scenario"], ranked["hazard_names"]]
    if SEVERITY in ranked:
        heads.append("severity")
        columns.append(ranked[SEVERITY].replace("", "-"))
    if contact or any(name.startswith(MARGIN) for name in units):
        heads.append("how bad")
        told = [_how_bad(row, contact, units) for row in ranked.to_dict("records")]
        columns.append(pd.Series(told, ranked.index, dtype=str))
    heads.append("hazard after")
    columns.append((ranked["t_hazard"] - ranked["t_activation"]).map("{:.2f} s".format))
    if has_alerts:
        heads.append("alert before")
        columns.append(ranked["warned"])
    links = [
        Link(fault, f"e={name}") for fault, name in zip(ranked["fault"], ranked["experiment_id"], strict=True)
    ]
    return Listing(heads=tuple(heads), lines=list(zip(links, *columns, strict=True)))


def _how_bad(row: Mapping[Any, Any], contact: str, units: Mapping[str, str]) -> str:
    """`delta-v 6.70 m/s` of a contact, else the least margin to the hazards that came; '-': not known."""
    if contact and row[contact] not in ("", "0.0"):
        words = "delta-v" if contact == "delta_v" else "contact at"
        return f"{words} {float(row[contact]):.2f} {units.get(contact, '')}"
    names = [f"{MARGIN}{name.lower()}" for name in row["hazard_names"].split(", ")]
    margins = [(float(row[name]), units[name]) for name in names if name in units and row[name] != ""]
    return "margin {:.2f} {}".format(*min(margins)) if margins else "-"


def unwarned(frame: pd.DataFrame) -> Answer:
    """Hazards before which no alert came."""
    hazards = frame[frame["outcome"] == "hazard"]
    silent = hazards[hazards["warning"] != FIRST]
    late = int((silent["warning"] == LATE).sum())
    says = f"{share(len(silent), len(hazards), 'hazards')} came with no alert before"
    says += f"; in {late} of these an alert came later." if late else "."
    lines = [
        (_kind(kind, warning=[NO_ALERT, LATE]), _part(part, of))
        for kind, part, of in _by_kind(silent, hazards)[:TYPES]
        if part
    ]
    links = (Link("These hazards", to_list({"warning": [NO_ALERT, LATE]})),) if len(silent) else ()
    return Answer(
        name="unwarned",
        title="What came without a warning",
        says=says,
        listings=(Listing(heads=("fault type", "no alert before / hazards"), lines=lines),),
        links=links,
    )


def survived(frame: pd.DataFrame) -> Answer:
    """Activated faults that no hazard followed."""
    active = frame[frame["is_activated"]]
    fine = active[active["outcome"].isin(["masked", "sdc"])]
    moved = int(fine["is_manifested"].sum())
    says = f"{share(len(fine), len(active), 'activated faults')} led to no hazard: "
    says += f"{len(fine) - moved:,} changed no actuator, {moved:,} did."
    by_kind = _by_kind(fine, active)
    whole = [kind for kind, part, of in by_kind if part == of]
    says += f" {share(len(whole), len(by_kind), 'fault types')} never led to one."
    fragile = sorted(by_kind, key=lambda k: (k[1] / k[2], -k[2], k[0]))[:TYPES]
    lines = [(_kind(kind, outcome=["masked", "sdc"]), _part(part, of)) for kind, part, of in fragile]
    return Answer(
        name="survived",
        title="What the controller survived",
        says=says,
        listings=(Listing(heads=("fault type, least survived first", "no hazard / activated"), lines=lines),),
        links=(
            Link("Masked", to_list({"outcome": ["masked"]})),
            Link("Manifested, no hazard", to_list({"outcome": ["sdc"]})),
        ),
    )


def _by_kind(part: pd.DataFrame, of: pd.DataFrame) -> list[tuple[str, int, int]]:
    """Fault type, how many of `part`, how many of `of`; most first."""
    parts = part["kind"].value_counts()
    counts = [(str(k), int(parts.get(k, 0)), int(n)) for k, n in of["kind"].value_counts().items()]
    return sorted(counts, key=lambda c: (-c[1], -c[2], c[0]))


def _kind(kind: str, **facets: Sequence[str]) -> Link:
    return Link(kind, to_list({"kind": [kind], **facets}))


def _part(part: int, of: int) -> Part:
    return Part(part, of, f"{part:,} of {of:,}")


def time_spent(frame: pd.DataFrame, timings: Mapping[str, Mapping[str, object]]) -> Answer:
    """CPU time of the experiments: in all, and by fault type."""
    cpu = frame["experiment_id"].map({name: float(str(line["cpu_s"])) for name, line in timings.items()})
    total, ran = float(cpu.sum()), int((cpu > 0).sum())
    workers = len({line["worker"] for line in timings.values()})
    says = f"{duration(total)} of CPU time, by {counted(workers, 'worker')}: "
    says += f"{share(ran, len(frame), 'experiments')} were driven"
    if ran < len(frame):
        says += "; the others needed no run of their own"
    says += "."
    if ran:
        says += f" Median {cpu[cpu > 0].median():.2f} s, longest {cpu.max():.2f} s."
    by_kind = cpu.groupby(frame["kind"]).sum().sort_values(ascending=False, kind="stable")
    lines = [
        (_kind(str(kind)), Part(float(s), total, f"{duration(float(s))} ({100 * s / total:.0f} %)"))
        for kind, s in by_kind.head(TYPES).items()
        if s > 0
    ]
    return Answer(
        name="time",
        title="Where the time went",
        says=says,
        listings=(Listing(heads=("fault type", "CPU time"), lines=lines),),
    )
