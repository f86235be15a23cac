"""Upgrade manifests of the schema target/1, which observed the same four values for every target."""

import re
from dataclasses import dataclass, replace
from itertools import takewhile
from pathlib import Path
from typing import Any

import yaml

from mutator._common.bounded import read_bounded
from mutator.config.yaml_files import MAX_BYTES, Keys, Source, parse
from mutator.errors import MutatorError

OLD, NEW = "target/1", "target/2"
# key of target/1 -> keys of target/2 that replace it
_REPLACED: dict[str, tuple[str, ...]] = {
    "schema": ("schema",),
    "observation": ("observation",),
    "trace_file": ("trace",),
    "time_channel": ("trace",),
    "record_file": ("record",),
    "compare": ("channels",),
    "plot": ("channels",),
}
_REQUIRED = ("trace_file", "time_channel", "record_file", "compare", "observation")
_COMMENT = re.compile(r"(?:^|(?<=\s))#[^\r\n]*", re.MULTILINE)
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
    """Return the manifest as target/2, with the old line numbers. MutatorError if a key that target/1
    requires is missing.
    """
    data, lines = dict(source.data), dict(source.lines)
    _check_complete(data, _REQUIRED, source, ())
    if isinstance(observation := data["observation"], dict):
        _check_complete(observation, ("t", *_OBSERVED), source, ("observation",))
        data["observation"] = _observation(observation, lines)
    if isinstance(data["compare"], dict) and isinstance(data.get("plot", {}), dict):
        data["channels"] = _channels(data, lines)
    data["trace"] = {"file": data.pop("trace_file"), "time": data.pop("time_channel")}
    lines[("trace",)] = lines["trace", "file"] = lines[("trace_file",)]
    data["record"] = data.pop("record_file")
    lines[("record",)] = lines[("record_file",)]
    return replace(source, data=data | {"schema": NEW}, lines=lines)


def _check_complete(data: dict[str, Any], keys: tuple[str, ...], source: Source, at: Keys) -> None:
    if missing := [key for key in keys if key not in data]:
        raise source.error(
            at,
            f"no `{missing[0]}`",
            expected=f"this key in a manifest of {OLD}",
            remedy=f"add it, or convert the manifest to {NEW}",
        )


def _observation(old: dict[str, Any], lines: dict[Keys, int]) -> dict[str, Any]:
    new = {key: value for key, value in old.items() if key not in ("t", *_OBSERVED)}
    new["time"] = old["t"]
    lines["observation", "time"] = lines["observation", "t"]
    new["values"] = {}
    for name, (unit, about) in _OBSERVED.items():
        new["values"][name] = {"is": old[name], "unit": unit, "about": about}
        lines["observation", "values", name] = lines["observation", name]
    formulas = {
        name: {"is": text, "unit": unit, "about": about} for name, (text, unit, about) in _DERIVED.items()
    }
    return new | {"derived": formulas}


def _channels(data: dict[str, Any], lines: dict[Keys, int]) -> dict[str, Any]:
    """Convert `compare` and `plot` to actuators and internal channels, and remove them from `data`. A channel
    in both becomes an actuator.
    """
    channels = dict[str, Any]()
    for key, role in (("compare", "actuator"), ("plot", "internal")):
        for name, channel in data.pop(key, {}).items():
            if name in channels:
                continue
            channels[name] = {**channel, "role": role} if isinstance(channel, dict) else channel
            for keys in [keys for keys in lines if keys[:2] == (key, name)]:
                lines["channels", *keys[1:]] = lines[keys]
    lines.setdefault(("channels",), lines[("compare",)])
    return channels


@dataclass(frozen=True, slots=True, kw_only=True)
class Upgrade:
    """A manifest as text of target/2; `lost` are the comments in the rewritten parts."""

    text: str
    lost: tuple[str, ...]


def upgraded_text(source: Source) -> Upgrade:
    """Rewrite only the changed keys of a target/1 manifest, and check the text against `upgraded`.

    If a key does not have its own lines, everything is rewritten. MutatorError if the text would not match.
    """
    text = read_bounded(source.path, MAX_BYTES).decode()
    new = upgraded(source).data
    for upgrade in (_line_by_line, _anew):
        done = upgrade(text, source, new)
        if _says(done.text, source.path) == new:
            return done
    raise MutatorError(
        "cannot be rewritten without changing its meaning",
        where=source.path,
        remedy=f"write it by hand: `schema: {NEW}`",
    )


def _says(text: str, path: Path) -> Any:
    try:
        return parse(text, path).data
    except MutatorError:
        return None


def _anew(text: str, source: Source, new: dict[str, Any]) -> Upgrade:
    dumped = "".join(_dumped(key, new[key]) for key in sorted(new, key=lambda key: key != "schema"))
    return Upgrade(text=dumped, lost=tuple(comment for _, comment in _comments(text)))


def _line_by_line(text: str, source: Source, new: dict[str, Any]) -> Upgrade:
    lines = text.splitlines(keepends=True)
    line_break = "\r\n" if "\r\n" in text else "\n"
    comments = _comments(text)
    begins = sorted((line - 1, keys[0]) for keys, line in source.lines.items() if len(keys) == 1)
    ends = [_end_of(lines, begin) for begin, _ in begins[1:]] + [len(lines)]
    new = {
        key: value for key, value in new.items() if key not in source.data or key in ("schema", "observation")
    }
    parts, lost = ["".join(lines[: _end_of(lines, begins[0][0])])], list[str]()
    for (begin, key), end in zip(begins, ends, strict=True):
        replaced = _REPLACED.get(str(key), ())
        parts.append("".join(lines[_end_of(lines, begin) : begin]))
        if not replaced:
            parts.append("".join(lines[begin:end]))
            continue
        dumped = "".join(_dumped(name, new.pop(name)) for name in replaced if name in new)
        parts.append(dumped.replace("\n", line_break))
        parts += takewhile(lambda line: not line.strip(), reversed(lines[begin:end]))
        lost += [comment for line, comment in comments if begin <= line < end]
    return Upgrade(text="".join(parts), lost=tuple(lost))


def _comments(text: str) -> list[tuple[int, str]]:
    """Return the line (from 0) and text of each comment."""
    masked = list(text)
    for token in yaml.scan(text, Loader=yaml.SafeLoader):
        if isinstance(token, yaml.ScalarToken):
            begin, end = token.start_mark.index, token.end_mark.index
            masked[begin:end] = ["\n" if letter == "\n" else "_" for letter in text[begin:end]]
    bare = "".join(masked)
    return [(bare.count("\n", 0, found.start()), found[0].strip()) for found in _COMMENT.finditer(bare)]


def _end_of(lines: list[str], begin: int) -> int:
    """Return the end of the part before line `begin`. Comments directly above a key belong to that key."""
    while begin and lines[begin - 1].startswith("#"):
        begin -= 1
    return begin


def _dumped(key: str, value: Any) -> str:
    text: str = yaml.safe_dump(
        {key: value},
        sort_keys=False,
        allow_unicode=True,
        width=110,
        default_flow_style=None if isinstance(value, dict) else False,  # short mappings on one line
    )
    return text
