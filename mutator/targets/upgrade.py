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
    data, lines = dict(source.data), dict(source.lines)
    if isinstance(observation := data.get("observation"), dict):
        data["observation"] = _observation(observation, lines)
    if isinstance(data.get("compare"), dict) and isinstance(data.get("plot", {}), dict):
        data["channels"] = _channels(data, lines)
    if "trace_file" in data and "time_channel" in data:
        data["trace"] = {"file": data.pop("trace_file"), "time": data.pop("time_channel")}
        lines[("trace",)] = lines["trace", "file"] = lines[("trace_file",)]
    if "record_file" in data:
        data["record"] = data.pop("record_file")
        lines[("record",)] = lines[("record_file",)]
    return replace(source, data=data, lines=lines)


def _observation(old: dict[str, Any], lines: dict[Keys, int]) -> dict[str, Any]:
    new = {key: value for key, value in old.items() if key not in ("t", *_OBSERVED)}
    if "t" in old:
        new["time"] = old["t"]
        lines["observation", "time"] = lines["observation", "t"]
    new["values"] = {}
    for name, (unit, about) in _OBSERVED.items():
        if name in old:
            new["values"][name] = {"is": old[name], "unit": unit, "about": about}
            lines["observation", "values", name] = lines["observation", name]
    return new | {"derived": derived()}


def _channels(data: dict[str, Any], lines: dict[Keys, int]) -> dict[str, Any]:
    """Of `compare` and `plot`, which leave `data`: actuators, and what the target told no role of."""
    channels = {}
    for key, role in (("compare", "actuator"), ("plot", "internal")):
        for name, channel in data.pop(key, {}).items():
            channels[name] = {**channel, "role": role} if isinstance(channel, dict) else channel
            for keys in [keys for keys in lines if keys[:2] == (key, name)]:
                lines["channels", *keys[1:]] = lines[keys]
    lines.setdefault(("channels",), lines[("compare",)])
    return channels


def derived() -> dict[str, dict[str, Any]]:
    """What followed from the observed values of every target."""
    return {
        name: {"is": text, "unit": unit, "about": about} for name, (text, unit, about) in _DERIVED.items()
    }
