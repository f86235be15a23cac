"""Generate code that ends a run at its first terminal hazard, by the manifest's conditions, or at a time."""

import ast
from inspect import getsource

from mutator.config.yaml_source_lines import KeyPath
from mutator.errors import MutatorError
from mutator.targets.hazard_and_metric_definitions import Hazard
from mutator.targets.manifest import TargetManifest
from mutator.triggers.conditions import TIME, divide, names_in, parse_expression, to_python_source

_STOP_REMEDY = "leave `after_hazard` out of the campaign, so that runs continue"


def stop_function_source(manifest: TargetManifest, end_s: float | None = None) -> str:
    """Return the source of a function `over(recorded)`, which says whether a terminal hazard holds in a step,
    or the time `end_s` is reached.

    `recorded` has the step's values, by their names in the trace. The code needs `math`, and `min` and `max`
    that propagate NaN. MutatorError if the target has no terminal hazard or no `entry.stepwise`, and for a
    hazard that cannot be decided from one step, because it has `for_s`, looks at earlier steps, is judged by
    the record or by temporal logic, or uses a channel that is not recorded in each step.
    """
    if manifest.stepwise_function is None:
        raise _cannot_stop_error(
            manifest, ("entry",), "no `stepwise`", "a run that can be ended between two steps"
        )
    conditions = [
        _stop_condition(manifest, hazard) for hazard in manifest.hazard_rules if hazard.terminal_condition
    ]
    if not conditions:
        raise _cannot_stop_error(manifest, ("hazards",), "no terminal hazard", "one with `terminal`")
    channels = {channel.name: channel for channel in manifest.channels}
    derived = [value for value in manifest.observation.derived if value.name not in channels]
    needed = {name for text in conditions for name in names_in(text)}
    for value in reversed(derived):
        needed |= {*names_in(value.text)} if value.name in needed else set()
    lines = [f"    {TIME} = float(recorded[{manifest.time_channel!r}])"]
    for channel in manifest.channels:
        if channel.name in needed and channel.times_channel:
            keys = ("channels", channel.name, "time")
            raise _cannot_stop_error(
                manifest, keys, f"{channel.name} has separate times", "a number in each step"
            )
        if channel.name in needed:
            lines.append(f"    {channel.name} = float(recorded[{channel.name_in_trace!r}])")
    lines += [
        f"    {v.name} = {to_python_source(v.text, is_formula=True)}" for v in derived if v.name in needed
    ]
    if end_s is not None:
        conditions.append(f"{TIME} >= {end_s}")
    holds = " or ".join(f"({to_python_source(text)})" for text in conditions)
    return "\n".join(
        [getsource(divide), "_div = divide", "def over(recorded):", *lines, f"    return {holds}", ""]
    )


def can_stop_at_hazard(manifest: TargetManifest) -> bool:
    """Return whether runs of this target can end at their first terminal hazard."""
    try:
        stop_function_source(manifest)
    except MutatorError:
        return False
    return True


def _stop_condition(manifest: TargetManifest, hazard: Hazard) -> str:
    has_end_condition = hazard.terminal_condition != "True"
    text = hazard.terminal_condition if has_end_condition else hazard.when
    keys = ("hazards", hazard.name)
    if not text:
        judge = "temporal logic" if hazard.required_stl else "the target itself"
        raise _cannot_stop_error(
            manifest, keys, f"{hazard.name}, which is judged by {judge}", "a condition, `when`"
        )
    if hazard.for_s and not has_end_condition:
        raise _cannot_stop_error(
            manifest, (*keys, "for_s"), f"{hazard.name} has `for_s`", "a condition of one step"
        )
    calls = {
        ast.unparse(node.func) for node in ast.walk(parse_expression(text)) if isinstance(node, ast.Call)
    }
    if earlier := calls & {"ever", "rate"}:
        got = f"{hazard.name} uses `{min(earlier)}`"
        raise _cannot_stop_error(manifest, keys, got, "a condition of a single step")
    return text


def _cannot_stop_error(manifest: TargetManifest, keys: KeyPath, got: str, expected: str) -> MutatorError:
    got = f"runs cannot stop at a terminal hazard: {got}"
    return manifest.source.error(keys, got, expected=expected, remedy=_STOP_REMEDY)
