"""Manifests of the schema target/1, whose observed values were the same four for every target."""

import re
from dataclasses import dataclass, replace
from typing import Any

import yaml

from mutator._common.files import no_pipe
from mutator.config.yaml_files import Keys, Source

OLD, NEW = "target/1", "target/2"
# key of target/1 -> keys of target/2 that are written in its place
_REPLACED: dict[str, tuple[str, ...]] = {
    "schema": ("schema",),
    "observation": ("observation",),
    "trace_file": ("trace",),
    "time_channel": ("trace",),
    "record_file": ("record",),
    "compare": ("channels",),
    "plot": ("channels",),
}
_COMMENT = re.compile(r"(?:^|\s)#")
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
    formulas = {
        name: {"is": text, "unit": unit, "about": about} for name, (text, unit, about) in _DERIVED.items()
    }
    return new | {"derived": formulas}


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Upgrade:
    """A manifest as text of target/2; `lost` are comments within what had to be written anew."""

    text: str
    lost: tuple[str, ...]


def upgraded_text(source: Source) -> Upgrade:
    """The file of a target/1 manifest with what changed written anew, and all else as it is."""
    lines = no_pipe(source.path).read_text(encoding="utf-8").splitlines(keepends=True)
    begins = sorted((line - 1, keys[0]) for keys, line in source.lines.items() if len(keys) == 1)
    ends = [_end_of(lines, begin) for begin, _ in begins[1:]] + [len(lines)]
    new = {"schema": NEW} | {
        key: value
        for key, value in upgraded(source).data.items()
        if key not in source.data or key == "observation"
    }
    text, lost = ["".join(lines[: _end_of(lines, begins[0][0])])], list[str]()
    for (begin, key), end in zip(begins, ends, strict=True):
        replaced = _REPLACED.get(str(key), ())
        above = begin - _end_of(lines, begin)
        text.append("".join(lines[begin - above : begin]))
        if not replaced:
            text.append("".join(lines[begin:end]))
            continue
        text += [_dumped(name, new.pop(name)) for name in replaced if name in new]
        lost += [line[line.index("#") :].strip() for line in lines[begin:end] if _COMMENT.search(line)]
    return Upgrade(text="".join(text), lost=tuple(lost))


def _end_of(lines: list[str], begin: int) -> int:
    """Where what comes before line `begin` ends: comments right above a key belong to it."""
    while begin and lines[begin - 1].startswith("#"):
        begin -= 1
    return begin


def _dumped(key: str, value: Any) -> str:
    text: str = yaml.safe_dump(
        {key: value},
        sort_keys=False,
        allow_unicode=True,
        width=110,
        default_flow_style=None if isinstance(value, dict) else False,  # short mappings in one line
    )
    return text
