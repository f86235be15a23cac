"""Explains the terms of a report's page: outcomes, hazards, severity, scenarios and triggers."""

from collections.abc import Mapping

from mutator.comparison.defended_pairs import PAIR_OUTCOME_MEANINGS
from mutator.config.yaml_files import load_yaml
from mutator.errors import MutatorError
from mutator.model import Method
from mutator.report.reported_run import ReportedRun
from mutator.results.outcome_counting import families_or_scenarios_of
from mutator.targets.hazard_severity import SeverityScale

Glossary = Mapping[str, Mapping[str, str]]  # heading -> term -> meaning

_COUNTING_TERMS = {
    "golden run": "the fault-free run that an experiment is compared with: same scenario, same seed",
    "injected": "experiments with a valid result: no harness error, no invalid mutant",
    "activated": "a changed statement ran while its trigger held",
    "manifested": "after activation, an actuator output differed from the golden run",
    "time to hazard": "the time from activation to the first hazard, also if the fault had ended by then",
    "FTTI": "the fault tolerant time interval: the shortest time from a fault to a hazardous event, if no "
    "safety mechanism acts (ISO 26262-1:2018); the shortest time of the sampled runs "
    "whose fault was still active is an upper bound",
    "margin": "the distance that a run kept from the limit of a hazard, negative beyond it; some hazards "
    "need more than a moment beyond it",
    "end of the drive": "the first terminal hazard, such as a contact: the simulation continues, but metrics "
    "and fault paths leave out later steps",
    "rank": "1 is the worst; the order is by severity, silent hazards first, then by margin and time",
}
_PLANE_TERMS = {
    "plane": "the magnitudes and durations of one fault, from one start on in one scenario",
    "cell": "one magnitude and duration of a plane",
    "inferred": "not driven: a shorter fault of this magnitude reached its hazard while it was active",
    "between runs": "not driven: the driven cells around it agree",
    "validation": "some cells that the search did not drive, but calls without hazard, are drawn and driven",
    "challenger": "an error that changes, as large as a constant one that is survived",
}
_DEFENCE_TERMS = {
    "defence": "what acts against a hazard: a safety mechanism, an external measure or a driver; it is "
    "spliced into the controller's tree",
    "set of defences": "the defences of one run, which repeats all experiments with them",
    "undefended, defended run": "the run without defences, and that with a set of them",
    "activation": "a row of steps in which a defence acts: it changes an actuator's command by more than the "
    "tolerance",
    "false activation": "an activation in a fault-free drive that has no hazard without defences",
    "unneeded activation": "an activation in an experiment that has no hazard without defences",
    "authority": "the command furthest from 0 that a defence needed",
    "conflict": "a step in which two defences disagree about an actuator",
    **{outcome.words: meaning for outcome, meaning in PAIR_OUTCOME_MEANINGS.items()},
}
_ENDING_TERMS = {
    "hazard": "a hazard occurred at or after activation",
    "sdc": "silent data corruption: the fault changed an actuator, without a hazard",
    "masked": "the fault was activated but changed no actuator, without a hazard",
    "not activated": "no changed statement ran while the trigger held",
    "crashed, timeout": "the fault crashed the program, or prevented it from finishing in time",
    "harness error, invalid mutant": "the experiment says nothing about the fault, so no share includes it",
}
_GOLDEN_HAZARD_TERMS = {
    "left out": "the golden run has a hazard without any fault, so the experiment did not run",
    "not judged": "the golden run has a hazard, and the fault was not active before it",
    "hazard free, hazard without fault": "whether the golden run ends well",
}
_ALERT_TERMS = {
    "silent hazard": "a hazard with no alert before it: either no alert at all, or only a later one",
    "hazard, no alert": "a silent hazard with no alert at all, not even a later one",
    "reaction time": "the time from the first alert to the hazard that follows it; the driver has at most "
    "this long, less if the hazard becomes inevitable before it comes",
}
_METHOD_MEANINGS = {
    Method.GUIDED.value: "the trigger is a condition, such as a context of the hazard analysis",
    Method.RANDOM.value: "the fault begins at a time drawn at random; random/C1 is the counterpart of C1",
}


def glossary_of(run: ReportedRun) -> Glossary:
    """Return the terms that the page explains. Terms that the run does not use are left out."""
    head = run.folder.head
    sections = {
        "How an experiment ends": _ENDING_TERMS,
        "Golden runs with a hazard": _GOLDEN_HAZARD_TERMS if run.folder.golden_hazards else {},
        "What is survived": _PLANE_TERMS if run.explored else {},
        "Defences": _DEFENCE_TERMS if run.defended_sets() else {},
        "What is counted": _COUNTING_TERMS,
        "Alerts": _ALERT_TERMS if run.folder.has_alerts else {},
        "Hazards": {hazard.name: hazard.about for hazard in head.about_hazards if hazard.about},
        "Severity": _severity_meanings(head.severity, in_words=True),
        "Scenarios": _scenario_meanings(run),
        "Triggers": _trigger_meanings(run),
    }
    return {title: terms for title, terms in sections.items() if terms}


def code_meanings_by_column(run: ReportedRun) -> Glossary:
    """Return the meanings of the codes in the list of experiments: column -> code -> meaning."""
    glossary = glossary_of(run)
    triggers = glossary.get("Triggers", {})
    drawn = run.results[run.results["method"] == Method.RANDOM.value]["trigger"].unique()
    at_random = {
        name: "a time drawn at random" + (f", as the counterpart of {of}" if of else "")
        for name, of in ((name, name.partition("/")[2]) for name in sorted(drawn))
    }
    endings = {
        name.replace(" ", "_"): about
        for names, about in (_ENDING_TERMS | _GOLDEN_HAZARD_TERMS).items()
        for name in names.split(", ")
    }
    return {
        "scenario": glossary.get("Scenarios", {}),
        "trigger": {**triggers, **at_random},
        "method": triggers,
        "ending": endings,
        "outcome": endings,
        "hazards": glossary.get("Hazards", {}),
        "severity": _severity_meanings(run.folder.head.severity),
    }


def _severity_meanings(scale: SeverityScale | None, *, in_words: bool = False) -> dict[str, str]:
    if not scale:
        return {}
    meanings = {
        (scale.labels[name] if in_words else name): f"delta-v of {low:.2f} m/s or more: {about}"
        for name, low, about in scale.classes
    }
    return meanings | {"no class": "no severity class; the column `no_severity` says why"}


def _scenario_meanings(run: ReportedRun) -> dict[str, str]:
    title_by_family = {family.name: family.title for family in run.folder.head.families}
    names = sorted(families_or_scenarios_of(run.results).unique())
    titles = {name: title_by_family.get(name) or _scenario_title(run, name) for name in names}
    return {name: about for name, about in titles.items() if about}


def _scenario_title(run: ReportedRun, name: str) -> str:
    """Return the `title` or `about` in a scenario's file; empty if the file has a format of its own."""
    if run.workspace is None:
        return ""
    try:
        data = load_yaml(run.workspace.scenario(name)).data
    except MutatorError:
        return ""
    title = (data.get("title") or data.get("about")) if isinstance(data, dict) else ""
    return " ".join(title.split()) if isinstance(title, str) else ""


def _trigger_meanings(run: ReportedRun) -> dict[str, str]:
    """Return the trigger methods if there are several, then the condition of each guided trigger."""
    methods = set(run.results["method"].unique())
    meanings = {name: about for name, about in _METHOD_MEANINGS.items() if len(methods) > 1}
    context_meanings = _context_meanings(run)
    guided = run.frame[run.frame["method"] == Method.GUIDED.value] if "condition" in run.frame else None
    if guided is None:
        return meanings
    pairs = guided[["trigger", "condition"]].drop_duplicates().sort_values("trigger")
    for name, condition in pairs.itertuples(index=False):
        about = context_meanings.get(name)
        meanings[name] = f"{about} ({condition})" if about else str(condition)
    return meanings


def _context_meanings(run: ReportedRun) -> dict[str, str]:
    """Return the contexts in the campaign's context table; empty if the table is not found."""
    try:
        table_name = load_yaml(run.folder.path / "campaign.yaml").data["triggers"]["table"]
        context_table = run.workspace.context_table(table_name) if run.workspace and table_name else None
    except (MutatorError, KeyError, TypeError):
        return {}
    return {row.id: " ".join(row.about.split()) for row in context_table.rows} if context_table else {}
