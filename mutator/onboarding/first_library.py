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
from mutator._common.shipped_files import make_empty
from mutator.errors import MutatorWarning
from mutator.onboarding.source_survey import Survey
from mutator.onboarding.step_candidates import LoopCandidate, loop_candidates
from mutator.onboarding.todo_marks import MARK

MOST_SHOWN = 5  # maximum number of candidates for the step, and of values of each
_TIME_STEPS = ("dt", "delta_t", "time_step", "timestep")
_FILES = {
    "README.md": "README.md",
    "manifest.yaml": "fault_library/targets/{name}.yaml",
    "drive.py": "fault_library/overlays/{name}/{entry}.py",
    "scenario.yaml": "fault_library/scenarios/first.yaml",
    "fault.yaml": "fault_library/faults/controller/value.yaml",
    "campaign.yaml": "fault_library/campaigns/first.yaml",
}


def write_library_for(found: Survey, folder: Path) -> None:
    """Write the files into a new or empty folder. MutatorError if the folder is not empty.

    MutatorWarning if no function in the source looks like a controller's step.
    """
    make_empty(folder)
    words = _words(found, folder.resolve())
    templates = Environment(
        loader=PackageLoader("mutator.onboarding", "files"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # output is YAML, Python and Markdown
    )
    templates.filters["yaml"] = _as_yaml
    for template, place in _FILES.items():
        path = folder / place.format(name=words["name"], entry=words["entry"])
        path.parent.mkdir(parents=True, exist_ok=True)
        text = templates.get_template(f"{template}.j2").render(words)
        path.write_text(re.sub(r"\n{4,}", "\n\n\n", text), encoding="utf-8")
    if not words["candidates"]:
        warnings.warn(_nothing_found(found), MutatorWarning, stacklevel=3)


def _nothing_found(found: Survey) -> str:
    why = [f"{place} cannot be read: {problem}" for place, problem in found.unread[:MOST_SHOWN]]
    if found.modules:
        why.insert(0, f"no function in {counted(len(found.modules), 'file')} looks like a step")
    reasons = "; ".join(why) or "no Python files apart from tests, docs and scripts"
    return f"{found.installed or found.root}: no controller found: {reasons}; fill in the files by hand"


def _as_yaml(text: str) -> str:
    plain = re.fullmatch(r"[\w./][\w./ -]*", text) and yaml.safe_load(text) == text
    return text if plain else json.dumps(text, ensure_ascii=False)


def _words(found: Survey, folder: Path) -> dict[str, Any]:
    candidates = loop_candidates(found)[:MOST_SHOWN]
    title = found.installed or (found.packages[0] if len(found.packages) == 1 else found.root.name)
    name = re.sub(r"\W+", "_", title.removesuffix(".py")).strip("_").lower()
    name = name if name[:1].isalpha() else f"controller_{name}".strip("_")
    taken = {package.removesuffix(".py") for package in found.packages}
    only = found.packages[0] if len(found.packages) == 1 else ""
    manifest = folder / "fault_library" / "targets"
    return {
        "name": name,
        "title": f"The controller in {found.root.name}",
        "entry": next(name for name in ("drive", "drive_loop", "drive_closed_loop") if name not in taken),
        "installed": found.installed,
        "requires": found.requires,
        "root": os.path.relpath(found.root, manifest),
        "root_shown": found.installed or found.root.name,
        "where": f"the installed package {found.installed}" if found.installed else f"`{found.root.name}`",
        "package": only if not only.endswith(".py") else "",
        "packages": found.packages,
        "count": counted(len(found.modules), "Python file"),
        "unread": found.unread[:MOST_SHOWN],
        "mark": MARK,
        "candidates": candidates,
        **_of_loop(candidates[0] if candidates else None),
    }


def _of_loop(best: LoopCandidate | None) -> dict[str, Any]:
    """Return the template variables that depend on the likeliest step of the loop."""
    if best is None:
        return dict.fromkeys(
            ("module", "imported", "builder", "call", "path", "function", "value", "others"), ""
        ) | {
            "run": "Drive",
            "thing": "the controller",
            "builds": (),
            "build_arguments": "",
        }
    called = "self.controller" if best.owner else best.function
    if best.owner and best.function != "__call__":
        called += f".{best.function}"
    first, *rest = best.values or (None,)
    places = ", ".join(f"{value.name} (line {value.line})" for value in rest[:MOST_SHOWN])
    return {
        "module": best.module,
        "imported": best.owner or best.function,
        "run": "Drive" if best.owner != "Drive" else "Loop",
        "thing": best.name,
        "builder": best.owner or "",
        "builds": best.builds,
        "build_arguments": ", ".join(f"{argument}=..." for argument in best.builds),
        "call": f"{called}({_arguments(best)})",
        "path": best.path,
        "function": best.name,
        "value": first,
        "others": f"Other values of {best.name}: {places}"
        if places
        else f"{best.name} ({best.path}:{best.line}) computes no other value",
    }


def _arguments(best: LoopCandidate) -> str:
    """Return call arguments: the state first, then the time step, and `...` for all others."""
    first, *others = best.needs or ("",)
    texts = [f"{name}={'self.step_s' if name in _TIME_STEPS else '...'}" for name in others]
    return ", ".join(["state", *texts]) if first else ""
