"""The contract of the probe `_fi`: its path, settings, source and report.

Code inside a target's process cannot import this module, so engines pass the needed values to that code.
"""

import ast
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from typing import Any

from mutator._common.hashing import content_id
from mutator.config.location_syntax import PROBE_MODULE_NAME
from mutator.errors import MutatorError
from mutator.faults.probe_template_parts import ProbeTemplates, TemplatePart
from mutator.model import Hold, Injection, ObservedActivation, Trigger
from mutator.mutants.template_rendering import render_template
from mutator.targets.observed_values import Observation
from mutator.triggers.conditions import TIME, canonical_condition, to_python_source

_SETTINGS_USED_BY_CODE_TEMPLATE = (
    "observed",
    "values",
    "counted",
    "sets",
)  # settings that the template of the code uses


@dataclass(frozen=True, kw_only=True)
class ProbeSettings:
    """The values in the probe's templates.

    `variables` are the arguments of the condition, and `values` those without the time; `observed` are the
    arguments of `observe`. `derived` are computed from them (name, expression). `counted`: the time is the
    number of observations times `step_s`. `sets`: the probe sets constants or defaults.
    """

    mutant: str
    injections: tuple[str, ...]
    hold: str
    hold_s: float
    armed_after_s: float
    condition: str
    variables: tuple[str, ...]
    values: tuple[str, ...]
    observed: tuple[str, ...]
    derived: tuple[tuple[str, str], ...]
    counted: bool
    step_s: float
    sets: bool


@dataclass(frozen=True, kw_only=True)
class ProbeSource:
    """A probe's source: parts with its own settings, and parts of code that all probes of a target share.

    In its file, they alternate.
    """

    settings_parts: tuple[str, ...]
    code_parts: tuple[str, ...]
    armed_after_s: float

    @property
    def text(self) -> str:
        return "".join(chain.from_iterable(zip(self.settings_parts, self.code_parts, strict=True)))

    @property
    def settings_and_code(self) -> tuple[str, str]:
        """The settings and the shared code. Run one after the other, they do the same as the whole.

        Blank lines keep the line numbers unchanged.
        """
        pairs = zip(self.settings_parts, self.code_parts, strict=True)
        padded_settings = (settings + "\n" * code.count("\n") for settings, code in pairs)
        lines_before_parts = tuple(settings.count("\n") for settings in self.settings_parts)
        return "".join(padded_settings), _padded_code(self.code_parts, lines_before_parts)

    @property
    def armed_condition(self) -> tuple[float, str]:
        """The time (s) from which it is armed, and the source of its condition on observed values."""
        return self.armed_after_s - _time_tolerance_s(self.code_parts), self.settings_parts[-1]


@lru_cache(maxsize=64)  # all mutants of a target share a few
def _padded_code(code_parts: tuple[str, ...], lines_before_parts: tuple[int, ...]) -> str:
    pairs = zip(lines_before_parts, code_parts, strict=True)
    return "".join("\n" * lines + code for lines, code in pairs)


def probe_path(package: str | None) -> str:
    """Return the path of the probe in a mutated tree; without a package, it is at the tree's root."""
    return f"{package}/{PROBE_MODULE_NAME}.py" if package else f"{PROBE_MODULE_NAME}.py"


def probe_module(package: str | None) -> str:
    return f"{package}.{PROBE_MODULE_NAME}" if package else PROBE_MODULE_NAME


def is_probe_path(path: str) -> bool:
    return path.rpartition("/")[2] == f"{PROBE_MODULE_NAME}.py"


def injection_id(index: int, injection: Injection) -> str:
    """Return the id of an injection in tags and reports, from its content and position in the fault."""
    # short, because it is in every injected line, and a fault has few injections
    return content_id([index, injection])[:8]


def build_probe_settings(
    mutant: str,
    trigger: Trigger,
    hold: Hold,
    injections: Sequence[str],
    observation: Observation,
    step_s: float,
    *,
    sets: bool = False,
) -> ProbeSettings:
    """Return the settings of a mutant's probe; with `sets`, the probe sets constants or defaults.

    MutatorError for a missing hold time, and for a condition on unobserved values.
    """
    if hold is Hold.FOR and trigger.hold_s is None:
        raise MutatorError(f"trigger '{trigger.name}' has the hold `for` without a time", expected="`hold_s`")
    names = tuple(value.name for value in observation.values)
    return ProbeSettings(
        mutant=mutant,
        injections=tuple(injections),
        hold=hold.value,
        hold_s=float(trigger.hold_s or 0.0),
        armed_after_s=float(trigger.armed_after_s),
        condition=to_python_source(canonical_condition(trigger.condition, variables=observation.variables)),
        variables=(TIME, *names),
        values=names,
        observed=tuple(name for name, _ in observation.name_expression_pairs),
        derived=tuple(
            (value.name, to_python_source(value.text, is_formula=True)) for value in observation.derived
        ),
        counted=observation.time is None,
        step_s=float(step_s),
        sets=sets,
    )


def render_probe(templates: ProbeTemplates, settings: ProbeSettings) -> ProbeSource:
    """Render the templates with these settings."""
    settings_parts = _render_parts(templates.settings, vars(settings))
    code = {name: getattr(settings, name) for name in _SETTINGS_USED_BY_CODE_TEMPLATE}
    code_parts = _render_code(templates.code, tuple(code.items()))
    return ProbeSource(
        settings_parts=settings_parts, code_parts=code_parts, armed_after_s=settings.armed_after_s
    )


@lru_cache(maxsize=16)  # all mutants of a target share one or two
def _render_code(parts: tuple[TemplatePart, ...], names: tuple[tuple[str, object], ...]) -> tuple[str, ...]:
    return _render_parts(parts, dict(names))


def _render_parts(parts: Sequence[TemplatePart], names: Mapping[str, object]) -> tuple[str, ...]:
    return tuple(render_template(part.text, names, part.path, part.line) for part in parts)


@lru_cache(maxsize=16)
def _time_tolerance_s(code_parts: tuple[str, ...]) -> float:
    """Return the tolerance of comparisons of times, which the template of the code sets."""
    for node in ast.walk(ast.parse("".join(code_parts))):
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "_TINY":
            return float(ast.literal_eval(node.value))
    raise AssertionError("a probe without _TINY")


# A running probe


def probe_attributes_after(
    observation_count: int, began: float | None, t: float | None
) -> tuple[str, dict[str, object]]:
    """Return the name of the object in which a probe keeps its observations, and that object's attributes.

    The first of `observation_count` observations was at time `began` (s), the last at `t`. A probe that
    replaces another probe gets these attributes.
    """
    return "_run", {"observed": observation_count, "began": began, "t": t} if observation_count else {}


# What a probe reports


def untriggered_report(mutant: str | None) -> dict[str, Any]:
    """Return the report of a mutant whose trigger never holds, limited to the entries that are read."""
    return {"mutant": mutant, "triggered": None, "injections": {}}


def report_problem(report: object, mutant: str, injections: Sequence[str]) -> str:
    """Return what is wrong with a probe's report for a mutant with these injections; empty if it is valid.

    Nothing in the report is trusted, because a mutant can overwrite anything in its probe.
    """
    if not isinstance(report, dict):
        return "its probe has no report"
    if report.get("mutant") != mutant:
        return "the probe that ran is not the one of this mutant"
    triggered, entries = report.get("triggered"), report.get("injections")
    if not isinstance(entries, dict) or entries.keys() != set(injections):
        return "the injections in its probe's report are not its own"
    if not all(_is_valid_report_entry(entry, "count") for entry in entries.values()):
        return "its probe's report of the injections is damaged"
    if not (triggered is None or (_is_valid_report_entry(triggered, "steps") and triggered["steps"])):
        return "its probe's report of the trigger is damaged"
    return "" if triggered or not activation_of(report) else "an injection was active and its trigger was not"


def _is_valid_report_entry(entry: object, count_key: str) -> bool:
    """Return whether an entry is valid: a first time, a last time and a count, or None, None and 0."""
    if not isinstance(entry, dict) or entry.keys() != {"first", "last", count_key}:
        return False
    first, last, count = entry["first"], entry["last"], entry[count_key]
    if type(count) is not int or count < 1:
        return type(count) is int and count == 0 and first is last is None
    return all(type(time) is float and math.isfinite(time) for time in (first, last)) and first <= last


def was_triggered(report: Mapping[str, Any] | None) -> bool:
    return bool(report and report["triggered"])


def activation_of(report: Mapping[str, Any]) -> ObservedActivation | None:
    """Return the first and last execution of any injection, and the number of executions; None if none."""
    injections = report.get("injections")
    ran = [i for i in injections.values() if i and i["count"]] if isinstance(injections, dict) else []
    if not ran:
        return None
    return ObservedActivation(
        first=min(i["first"] for i in ran),
        last=max(i["last"] for i in ran),
        count=sum(i["count"] for i in ran),
    )
