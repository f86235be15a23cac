"""Answers which fault types to fix first, and which component lets them through."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from math import inf

import pandas as pd

from mutator.outcomes.fault_paths import UntimedPath
from mutator.report.answer_parts import FIRST, SILENT, Answer, Cell, Link, Listing, kind_link, share, to_list
from mutator.report.fault_path_data import RunPaths, link_text
from mutator.report.most_dangerous import NO_CONTACT, SEVERITY

LISTED = 5  # maximum number of fault types listed


def first_to_fix(frame: pd.DataFrame, paths: RunPaths | None, *, has_alerts: bool) -> Answer:
    """Say which fault types to fix first: those with the most silent hazards in the highest severity
    class; ties are broken by the next lower classes, then by hazards without contact, then by the shortest
    time from activation to hazard. If the target has no alerts, all hazards are counted. `frame` must have at
    least one hazard.
    """
    hazards = frame[frame["outcome"] == "hazard"]
    counted = hazards[hazards["warning"] != FIRST] if has_alerts else hazards
    if counted.empty:  # all hazards came after an alert, so count all
        counted, has_alerts = hazards, False
    classes = _classes(counted)
    order = _order(counted, classes)
    what = "silent hazards" if has_alerts else "hazards"
    heads = ["fault type", f"{what} by severity" if SEVERITY in counted else what, "shortest time to hazard"]
    heads += ["passed on to an actuator by", "stopped by, of all active"] if paths else []
    only: Mapping[str, Sequence[str]] = {"warning": SILENT} if has_alerts else {"outcome": ["hazard"]}
    lines = [
        _line(kind, frame[frame["kind"] == kind], counted[counted["kind"] == kind], classes, only, paths)
        for kind in order[:LISTED]
    ]
    return Answer(
        name="first",
        title="What to fix first",
        wide=True,
        says=_says(order, counted, classes, what),
        listings=(Listing(heads=tuple(heads), lines=lines),),
    )


def _classes(hazards: pd.DataFrame) -> list[str]:
    """Return the severity classes that occur, highest first; no contact ('') is last."""
    return sorted(hazards[SEVERITY].unique(), reverse=True) if SEVERITY in hazards else [""]


def _of_class(hazards: pd.DataFrame, name: str) -> pd.DataFrame:
    return hazards[hazards[SEVERITY] == name] if SEVERITY in hazards else hazards


def _after(hazards: pd.DataFrame) -> pd.Series:
    """Return the times from activation to hazard, s."""
    return hazards["t_hazard"] - hazards["t_activation"]


def _order(hazards: pd.DataFrame, classes: Sequence[str]) -> list[str]:
    groups = {str(kind): group for kind, group in hazards.groupby("kind")}
    key = {
        kind: (*(-len(_of_class(group, name)) for name in classes), float(_after(group).min()), kind)
        for kind, group in groups.items()
    }
    return sorted(groups, key=key.__getitem__)


def _says(order: Sequence[str], counted: pd.DataFrame, classes: Sequence[str], what: str) -> str:
    mine = counted["kind"] == order[0]
    says = f"Start with {order[0]}: {share(int(mine.sum()), len(counted), what)}"
    if classes[0]:
        of_class = counted[SEVERITY] == classes[0]
        part, all_ = int((mine & of_class).sum()), int(of_class.sum())
        says += f", and {'the only one' if all_ == 1 else f'{part} of {all_}'} of severity {classes[0]}"
        says += f", the highest among the {what}"
    says += f". The rule: fault types with the most {what}"
    if len(classes) > 1:
        says += " of the highest severity come first; ties are broken by the next lower class, then by"
    else:
        says += " come first; ties are broken by"
    says += " the shortest time from fault to hazard."
    if len(order) > LISTED:
        says += f" The table shows the first {LISTED} of {len(order)} fault types."
    return says


def _line(
    kind: str,
    all_of_kind: pd.DataFrame,
    counted: pd.DataFrame,
    classes: Sequence[str],
    only: Mapping[str, Sequence[str]],
    paths: RunPaths | None,
) -> tuple[Cell, ...]:
    told = [(name, len(_of_class(counted, name))) for name in classes]
    if SEVERITY in counted:
        named = [f"{n} severity {name}" if name else f"{n} without contact" for name, n in told if n]
        numbers = ", ".join(named)
    else:
        numbers = f"{len(counted):,}"
    after = _after(counted)
    fastest = str(counted["experiment_id"].iloc[int(after.fillna(inf).argmin())])
    worst = next((name for name, n in told if n), "")
    facets = {"kind": [kind], **only}
    severe = {SEVERITY: [worst or NO_CONTACT]} if SEVERITY in counted else {}
    line: list[Cell] = [
        kind_link(kind, **only),
        Link(numbers, to_list({**facets, **severe}, "rank")),
        Link(f"{after.min():.2f} s", f"e={fastest}&{to_list(facets, 'rank')}"),
    ]
    if paths:
        active = all_of_kind[all_of_kind["is_activated"]]
        line += [_let_through(kind, counted, only, paths), _stopped(kind, active, paths)]
    return tuple(line)


def _let_through(
    kind: str, hazards: pd.DataFrame, only: Mapping[str, Sequence[str]], paths: RunPaths
) -> Cell:
    """Return the component that most often let this fault type through to the first changed actuator."""
    passed: Counter[str] = Counter()
    links: dict[str, set[str]] = {}
    for untimed_path, count in _untimed_paths(hazards, paths):
        if link := untimed_path.entry_link:
            passed[link.tail] += count
            links.setdefault(link.tail, set()).add(link_text(link.tail, link.tip))
    if not passed:
        return "-"
    component = min(passed, key=lambda name: (-passed[name], name))
    to = to_list({"kind": [kind], **only, "through": sorted(links[component])}, "rank")
    return Link(f"{paths.label(component)}: {passed[component]} of {len(hazards)}", to)


def _untimed_paths(frame: pd.DataFrame, paths: RunPaths) -> Iterator[tuple[UntimedPath, int]]:
    for code, count in frame["untimed_path"].value_counts(sort=False).items():
        if (place := int(str(code))) >= 0:
            yield paths.untimed_paths[place], int(count)


def _stopped(kind: str, active: pd.DataFrame, paths: RunPaths) -> Cell:
    """Return the component that stopped most faults of this type, a candidate for stopping the rest."""
    stopped: Counter[str] = Counter()
    for untimed_path, count in _untimed_paths(active, paths):
        for name in untimed_path.stopped_at:
            stopped[name] += count
    if not stopped:
        return f"none of {len(active):,}"
    component = min(stopped, key=lambda name: (-stopped[name], name))
    text = f"{paths.label(component)}: {stopped[component]:,} of {len(active):,}"
    return Link(text, to_list({"kind": [kind], "stopped_at": [component]}))
