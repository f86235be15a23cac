"""The words of a report's page, explained: outcomes, hazards, severity, scenarios, triggers."""

from collections.abc import Mapping

import yaml

from mutator.errors import MutatorError
from mutator.model import Method
from mutator.report.studies import ReportedRun
from mutator.report.warnings import LATE, NO_ALERT

Words = Mapping[str, Mapping[str, str]]  # heading -> term -> meaning

_RUNS = {
    "golden run": "the run without a fault that an experiment is compared with: same scenario, same seed",
    "injected": "experiments that say something about their fault: no harness error, no invalid mutant",
    "activated": "a changed statement ran while its trigger held",
    "manifested": "after that an actuator output differed from the golden run",
    "fault-tolerant time": "from the activation to the first hazard",
    "margin": "how far a run stayed from a hazard, negative in it",
    "rank": "1 is the worst: by severity, then delta-v; without contact by ending, then margin",
}
_ENDINGS = {
    "hazard": "a hazard came at or after the activation",
    "sdc": "silent data corruption: the fault changed an actuator, and no hazard came",
    "masked": "the fault was activated, changed no actuator, and no hazard came",
    "not activated": "no changed statement ran while the trigger held",
    "crashed, timeout": "the fault ended the program, or kept it from ending",
    "harness error, invalid mutant": "says nothing about the fault, and is in no count but its own",
}
_ALERTS = {
    "silent hazard": f"no alert came before it: {NO_ALERT}, or an {LATE.removesuffix(' the hazard')} it",
    "hazard, no alert": "in tables: no alert at all, the narrower meaning",
    "reaction time": "from the first alert to the hazard that follows it",
}
_METHODS = {
    Method.GUIDED.value: "the trigger is a condition, such as a context of the hazard analysis",
    Method.RANDOM.value: "the fault begins at a time drawn at random; random/C1 is the counterpart of C1",
}


def words_of(run: ReportedRun) -> Words:
    """What the page explains, without what a run has nothing of."""
    head = run.folder.head
    found = {
        "How an experiment ends": _ENDINGS,
        "What is counted": _RUNS,
        "Alerts": _ALERTS if run.folder.has_alerts else {},
        "Hazards": {one["name"]: one["about"] for one in head.get("about_hazards") or () if one["about"]},
        "Severity": _severity(head.get("severity")),
        "Scenarios": _scenarios(run),
        "Triggers": _triggers(run),
    }
    return {title: words for title, words in found.items() if words}


def _severity(scale: Mapping[str, object] | None) -> dict[str, str]:
    """The classes with the delta-v that each begins at."""
    if not scale:
        return {}
    classes = scale["classes"]
    assert isinstance(classes, list)
    told = {f"severity {name}": f"delta-v from {low:.2f} m/s on: {about}" for name, low, about in classes}
    return told | {"no contact": "no class; such hazards rank by margin, their kinds taking turns"}


def _scenarios(run: ReportedRun) -> dict[str, str]:
    """What the files of the scenarios say they are, where they say it."""
    names = sorted(run.texts["scenario"].unique())
    return {name: about for name in names if (about := _title(run, name))}


def _title(run: ReportedRun, name: str) -> str:
    """The `title` or `about` of a scenario's file, which may be of any form."""
    if run.workspace is None:
        return ""
    try:
        data = yaml.safe_load(run.workspace.scenario(name).read_text(encoding="utf-8"))
    except (MutatorError, OSError, ValueError, yaml.YAMLError):
        return ""
    told = (data.get("title") or data.get("about")) if isinstance(data, dict) else ""
    return " ".join(str(told or "").split())


def _triggers(run: ReportedRun) -> dict[str, str]:
    """The methods, then what each guided trigger waits for."""
    methods = set(run.texts["method"].unique())
    told = {name: about for name, about in _METHODS.items() if name in methods}
    abouts = _contexts(run)
    guided = run.frame[run.frame["method"] == Method.GUIDED.value] if "condition" in run.frame else None
    if guided is None:
        return told
    pairs = guided[["trigger", "condition"]].drop_duplicates().sort_values("trigger")
    for name, condition in pairs.itertuples(index=False):
        about = abouts.get(name)
        told[name] = f"{about} ({condition})" if about else str(condition)
    return told


def _contexts(run: ReportedRun) -> dict[str, str]:
    """The contexts of the table that the campaign takes its triggers from, if it is there."""
    try:
        campaign = yaml.safe_load((run.folder.path / "campaign.yaml").read_text(encoding="utf-8"))
        table = campaign["triggers"]["table"]
        found = run.workspace.context_table(table) if run.workspace and table else None
    except (MutatorError, OSError, ValueError, KeyError, TypeError, yaml.YAMLError):
        return {}
    return {row.id: " ".join(row.about.split()) for row in found.rows} if found else {}
