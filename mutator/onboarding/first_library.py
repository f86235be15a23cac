"""Writes a first library for a source tree: manifest, entry, scenario, fault, campaign, README."""

import json
import os
import re
import warnings
from pathlib import Path
from typing import Any

import yaml
from jinja2 import Environment, PackageLoader, StrictUndefined

from mutator._common.message_text import counted
from mutator._common.shipped_files import make_empty_folder
from mutator.errors import MutatorWarning
from mutator.onboarding.source_survey import SourceSurvey
from mutator.onboarding.step_candidates import (
    StepCandidate,
    group_by_function_name,
    list_step_candidates,
)
from mutator.onboarding.todo_marks import TODO_MARK

MOST_LISTED_ROWS = 15  # of candidates for the step
MOST_LISTED_PLACES = 5  # of values of a candidate, candidates of one name, and unreadable files
# parameters that get the step length instead of `...`
_TIME_STEP_PARAMETERS = ("dt", "delta_t", "time_step", "timestep")
_PATH_BY_TEMPLATE = {
    "README.md": "README.md",
    "manifest.yaml": "fault_library/targets/{name}.yaml",
    "drive.py": "fault_library/overlays/{name}/{entry}.py",
    "scenario.yaml": "fault_library/scenarios/first.yaml",
    "fault.yaml": "fault_library/faults/controller/value.yaml",
    "campaign.yaml": "fault_library/campaigns/first.yaml",
}


def write_first_library(survey: SourceSurvey, folder: Path) -> None:
    """Write the files into a new or empty folder. MutatorError if the folder is not empty.

    MutatorWarning if no function in the source looks like a controller's step.
    """
    make_empty_folder(folder)
    variables = _template_variables(survey, folder.resolve())
    templates = Environment(
        loader=PackageLoader("mutator.onboarding", "files"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # output is YAML, Python and Markdown
    )
    templates.filters["yaml"] = _yaml_scalar
    for template, form in _PATH_BY_TEMPLATE.items():
        path = folder / form.format(name=variables["name"], entry=variables["entry"])
        path.parent.mkdir(parents=True, exist_ok=True)
        text = templates.get_template(f"{template}.j2").render(variables)
        # parts that a template leaves out leave their blank lines behind
        path.write_text(re.sub(r"\n{4,}", "\n\n\n", text), encoding="utf-8")
    if not variables["rows"]:
        warnings.warn(_describe_no_controller(survey), MutatorWarning, stacklevel=3)


def _describe_no_controller(survey: SourceSurvey) -> str:
    problems = [
        f"{place} cannot be read: {problem}"
        for place, problem in survey.unreadable_files[:MOST_LISTED_PLACES]
    ]
    if survey.modules:
        problems.insert(0, f"no function in {counted(len(survey.modules), 'file')} looks like a step")
    reasons = "; ".join(problems) or "no Python files apart from tests, docs and scripts"
    source = survey.installed_package or survey.root
    return f"{source}: no controller found: {reasons}; fill in the files by hand"


def _yaml_scalar(text: str) -> str:
    plain = re.fullmatch(r"[\w./][\w./ -]*", text) and yaml.safe_load(text) == text
    return text if plain else json.dumps(text, ensure_ascii=False)


def _template_variables(survey: SourceSurvey, folder: Path) -> dict[str, Any]:
    candidates = list_step_candidates(survey)
    groups = group_by_function_name(candidates)
    title = survey.installed_package or (
        survey.packages[0] if len(survey.packages) == 1 else survey.root.name
    )
    name = re.sub(r"\W+", "_", title.removesuffix(".py")).strip("_").lower()
    name = name if name[:1].isalpha() else f"controller_{name}".strip("_")
    package_names = {package.removesuffix(".py") for package in survey.packages}
    only_package = survey.packages[0] if len(survey.packages) == 1 else ""
    manifest_folder = folder / "fault_library" / "targets"
    return {
        "name": name,
        "title": f"The controller in {survey.root.name}",
        "entry": next(
            name for name in ("drive", "drive_loop", "drive_closed_loop") if name not in package_names
        ),
        "installed": survey.installed_package,
        "requires": survey.requirement,
        "root": os.path.relpath(survey.root, manifest_folder),
        "root_shown": survey.installed_package or survey.root.name,
        "where": f"the installed package {survey.installed_package}"
        if survey.installed_package
        else f"`{survey.root.name}`",
        "package": only_package if not only_package.endswith(".py") else "",
        "packages": survey.packages,
        "count": counted(len(survey.modules), "Python file"),
        "unread": survey.unreadable_files[:MOST_LISTED_PLACES],
        "mark": TODO_MARK,
        "candidate_count": len(candidates),
        "rows": [(first, _describe_others(others)) for first, *others in groups[:MOST_LISTED_ROWS]],
        "equally_likely": sum(each.likelihood == candidates[0].likelihood for each in candidates),
        "shadowing": survey.shadowing_modules,
        **_step_variables(candidates[0] if candidates else None),
    }


def _describe_others(others: list[StepCandidate]) -> str:
    """Say where functions of the same name are."""
    if not others:
        return ""
    places = [f"`{other.name}` ({other.path}:{other.line})" for other in others[:MOST_LISTED_PLACES]]
    more = len(others) - len(places)
    return f"; also {', '.join(places)}" + (f" and {more} more" if more else "")


def _step_variables(best: StepCandidate | None) -> dict[str, Any]:
    """Return the template variables that depend on the likeliest step of the loop."""
    if best is None:
        return dict.fromkeys(
            ("module", "imported", "builder", "call", "path", "function", "value", "others"), ""
        ) | {
            "run": "Drive",
            "is_async": False,
            "thing": "the controller",
            "builds": (),
            "build_arguments": "",
        }
    called = "self.controller" if best.class_name else best.function
    if best.class_name and best.function != "__call__":
        called += f".{best.function}"
    call = f"{called}({_render_call_arguments(best)})"
    first, *rest = best.values or (None,)
    places = ", ".join(f"{value.name} (line {value.line})" for value in rest[:MOST_LISTED_PLACES])
    return {
        "module": best.module,
        "imported": best.class_name or best.function,
        "run": "Drive" if best.class_name != "Drive" else "Loop",
        "thing": best.name,
        "builder": best.class_name or "",
        "builds": best.constructor_arguments,
        "build_arguments": ", ".join(f"{argument}=..." for argument in best.constructor_arguments),
        "call": f"asyncio.run({call})" if best.is_async else call,
        "is_async": best.is_async,
        "path": best.path,
        "function": best.name,
        "value": first,
        "others": f"Other values of {best.name}: {places}"
        if places
        else f"{best.name} ({best.path}:{best.line}) computes no other value",
    }


def _render_call_arguments(best: StepCandidate) -> str:
    """Return call arguments: the state first, then the time step, and `...` for all others."""
    first, *others = best.required_arguments or ("",)
    texts = [f"{name}={'self.step_s' if name in _TIME_STEP_PARAMETERS else '...'}" for name in others]
    return ", ".join(["state", *texts]) if first else ""
