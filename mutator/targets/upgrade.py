"""Manifests of the schema target/1, whose observed values were the same four for every target."""

from dataclasses import replace
from typing import Any

from mutator.config.yaml_files import Keys, Source

OLD = "target/1"
_OBSERVED = {
    "d_rel": ("m", "distance to the vehicle ahead"),
    "v_ego": ("m/s", "the car's own speed"),
    "v_lead": ("m/s", "speed of the vehicle ahead"),
}
_DERIVED = {
    "hwt": ("d_rel / v_ego if v_ego > 0 else inf", "s", "headway time; infinite at standstill"),
    "rs": ("v_ego - v_lead", "m/s", "relative speed, positive when closing in"),
}


def upgraded(source: Source) -> Source:
    """The manifest as one of target/2; its values keep their lines. What is no manifest stays as it is."""
    observation = source.data.get("observation")
    if not isinstance(observation, dict):
        return source
    rest = {key: value for key, value in observation.items() if key not in ("t", *_OBSERVED)}
    lines: dict[Keys, int] = dict(source.lines)
    if "t" in observation:
        rest["time"] = observation["t"]
        lines["observation", "time"] = source.lines["observation", "t"]
    rest["values"] = {}
    for name, (unit, about) in _OBSERVED.items():
        if name in observation:
            rest["values"][name] = {"is": observation[name], "unit": unit, "about": about}
            lines["observation", "values", name] = source.lines["observation", name]
    rest["derived"] = derived()
    return replace(source, data={**source.data, "observation": rest}, lines=lines)


def derived() -> dict[str, dict[str, Any]]:
    """What followed from the observed values of every target."""
    return {
        name: {"is": text, "unit": unit, "about": about} for name, (text, unit, about) in _DERIVED.items()
    }
