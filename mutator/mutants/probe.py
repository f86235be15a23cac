"""The contract of the probe `_fi`, rendered from `templates/_fi.py.j2`: its path, template values and report.

Code inside a target's process cannot import this module, so engines pass the needed values to that code.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from types import CodeType
from typing import Any

from mutator._common.hashing import content_id
from mutator.config.locations import PROBE_NAME
from mutator.errors import MutatorError
from mutator.model import Activation, Hold, Injection, Trigger
from mutator.targets.observation import Observation
from mutator.triggers.conditions import TIME, check_condition, to_code

# the part of a probe that differs between mutants: docstring, settings, condition
_OWN = re.compile(
    r'\A"""(?s:.*?)"""\n|^MUTANT = (?s:.*?)^_TINY = .*\n|^def _condition\((?s:.*?)^(?=\n)', re.MULTILINE
)
_ARMED = re.compile(r"^ARMED_AFTER_S = (.+)$(?s:.*)^_TINY = (.+)$", re.MULTILINE)


def probe_path(package: str | None) -> str:
    """Return the path of the probe in a mutated tree; without a package, it is at the tree's root."""
    return f"{package}/{PROBE_NAME}.py" if package else f"{PROBE_NAME}.py"


def probe_module(package: str | None) -> str:
    return f"{package}.{PROBE_NAME}" if package else PROBE_NAME


def is_probe(path: str) -> bool:
    return path.rpartition("/")[2] == f"{PROBE_NAME}.py"


def injection_id(index: int, injection: Injection) -> str:
    """Return the id of an injection in tags and reports, from its content and position in the fault."""
    return content_id([index, injection])[:8]


def template_values(
    mutant: str,
    trigger: Trigger,
    hold: Hold,
    injections: Sequence[str],
    observation: Observation,
    step_s: float,
    *,
    sets: bool = False,
) -> dict[str, object]:
    """Return the values for the probe's template; with `sets`, the probe sets constants or defaults.

    MutatorError for a missing hold time, and for a condition on unobserved values.
    """
    if hold is Hold.FOR and trigger.hold_s is None:
        raise MutatorError(f"trigger '{trigger.name}' has the hold `for` without a time", expected="`hold_s`")
    names = [value.name for value in observation.values]
    return {
        "mutant": mutant,
        "condition": to_code(check_condition(trigger.condition, variables=observation.variables)),
        "values": names,
        "variables": [TIME, *names],
        "observed": [name for name, _ in observation.expressions],
        "derived": [(value.name, to_code(value.text, number=True)) for value in observation.derived],
        "counted": observation.time is None,
        "step_s": float(step_s),
        "hold": hold.value,
        "hold_s": float(trigger.hold_s or 0.0),
        "armed_after_s": float(trigger.armed_after_s),
        "injections": injections,
        "sets": sets,
    }


# A running probe


def parts_of(probe: str) -> tuple[str, str]:
    """Split a probe's source into its own part and the part that all probes of a target share.

    Run one after the other, the parts do the same as the whole. Blank lines keep the line numbers unchanged.
    """
    own, common, at = [], [], 0
    for found in _OWN.finditer(probe):
        between = probe[at : found.start()]
        own += ["\n" * between.count("\n"), found[0]]
        common += [between, "\n" * found[0].count("\n")]
        at = found.end()
    return ("".join(own), "".join([*common, probe[at:]])) if at else (probe, "")


def decision(probe: CodeType) -> tuple[float, Callable[..., bool]]:
    """Return the time (s) from which a probe is armed, and its condition as a function of observed values.

    Calling `observe` for every value instead takes almost four times as long.
    """
    module: dict[str, Any] = {"__name__": PROBE_NAME}
    exec(probe, module)
    return module["ARMED_AFTER_S"] - module["_TINY"], module["_condition"]


def decision_in(own: str) -> tuple[float, str]:
    """Like `decision`, but from the source of a probe's own part, and with the condition as source."""
    armed = _ARMED.search(own)
    assert armed is not None
    return float(armed[1]) - float(armed[2]), own[own.index("def _condition(") :]


def state_after(observed: int, began: float | None, t: float | None) -> tuple[str, dict[str, object]]:
    """Return the name of the object in which a probe keeps its observations, and that object's attributes.

    The first of `observed` observations was at time `began` (s), the last at `t`. A probe that replaces
    another probe gets these attributes.
    """
    return "_run", {"observed": observed, "began": began, "t": t} if observed else {}


# What a probe reports


def silent_report(mutant: str | None) -> dict[str, Any]:
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
    triggered, told = report.get("triggered"), report.get("injections")
    if not isinstance(told, dict) or told.keys() != set(injections):
        return "the injections in its probe's report are not its own"
    if not all(_is_told(one, "count") for one in told.values()):
        return "its probe's report of the injections is damaged"
    if not (triggered is None or (_is_told(triggered, "steps") and triggered["steps"])):
        return "its probe's report of the trigger is damaged"
    return "" if triggered or not activation_of(report) else "an injection was active and its trigger was not"


def _is_told(told: object, number: str) -> bool:
    """Return whether an entry is valid: a first time, a last time and a count, or None, None and 0."""
    if not isinstance(told, dict) or told.keys() != {"first", "last", number}:
        return False
    first, last, count = told["first"], told["last"], told[number]
    if type(count) is not int or count < 1:
        return type(count) is int and count == 0 and first is last is None
    return all(type(time) is float and math.isfinite(time) for time in (first, last)) and first <= last


def was_triggered(report: Mapping[str, Any] | None) -> bool:
    return bool(report and report["triggered"])


def activation_of(report: Mapping[str, Any]) -> Activation | None:
    """Return the first and last execution of any injection, and the number of executions; None if none."""
    injections = report.get("injections")
    ran = [i for i in injections.values() if i and i["count"]] if isinstance(injections, dict) else []
    if not ran:
        return None
    return Activation(
        first=min(i["first"] for i in ran),
        last=max(i["last"] for i in ran),
        count=sum(i["count"] for i in ran),
    )
