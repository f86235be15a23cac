"""Writes the reference of scenario files: a page, and a JSON Schema for editors.

`python -m selfdrive.sim.scenario_page [--out docs/reference]` writes scenario.md and schemas/scenario.json
from the parser's keys and bounds.
"""

import argparse
import json
from pathlib import Path
from typing import Any

from selfdrive.common.realtime import DT_CTRL
from selfdrive.sim import scenario as s

TEXT = f"""\
# Scenarios

<!-- Written by `python -m selfdrive.sim.scenario_page`; do not edit by hand. -->

A scenario file in `fault_library/scenarios/` describes the controlled car (the host), the lead, the driver
and the road. Only the target reads scenarios; this page lists the keys that the shipped target accepts.
[Add a scenario](../how-to/add-a-scenario.md) has an example, and
[an editor can check the files](../how-to/edit-with-completion.md).

The key of a number ends in its unit. Times are multiples of {DT_CTRL:g} s. An unknown key is an error
with file and line.
"""


def _number(low: float, high: float) -> dict[str, Any]:
    return {"type": "number", "minimum": low, "maximum": high}


def _numbers(low: float, high: float) -> dict[str, Any]:
    return {"type": "array", "items": _number(low, high), "minItems": 1}


def _word(words: Any) -> dict[str, Any]:
    return {"enum": list(words)}


_TEXT = {"type": "string"}
_SPEED = dict.fromkeys((f"speed_{unit}" for unit in s.SPEED_UNITS), _number(0.0, s.FASTEST))
_SPEEDS = {key: {"anyOf": [speed, _numbers(0.0, s.FASTEST)]} for key, speed in _SPEED.items()}
_TIME = _number(0.0, s.LONGEST)

# By section heading: the keys with their meanings, their types, and the required keys.
SECTIONS: dict[str, tuple[dict[str, str], dict[str, dict[str, Any]], tuple[str, ...]]] = {
    "scenario": (
        s.KEYS,
        {
            "schema": {"const": s.SCHEMA},
            "name": _TEXT,
            "title": _TEXT,
            "duration_s": _number(DT_CTRL, s.LONGEST),
            "host": {"$ref": "#/definitions/host"},
            "lead": {"$ref": "#/definitions/lead"},
            "buttons": {"type": "array", "items": {"$ref": "#/definitions/button"}},
            "plant": _word(s.PLANTS),
            "road": {"$ref": "#/definitions/road"},
        },
        ("schema", "name", "title", "duration_s", "host"),
    ),
    "host": (s.HOST_KEYS, {**_SPEED, "lateral_offset_m": _number(-10.0, 10.0)}, ()),
    "lead": (
        s.LEAD_KEYS,
        {"gap_m": _number(0.0, s.FARTHEST), **_SPEEDS, "at_s": _numbers(0.0, s.LONGEST)},
        ("gap_m",),
    ),
    "button": (
        s.BUTTON_KEYS,
        {"button": _word(s.BUTTONS), "press_s": _TIME, "release_s": _TIME},
        ("button", "press_s", "release_s"),
    ),
    "road": (
        s.ROAD_KEYS,
        {"grade": {"$ref": "#/definitions/grade"}, "curvature": {"$ref": "#/definitions/curvature"}},
        (),
    ),
    "grade": (
        s.GRADE_KEYS,
        {"at_s": _numbers(0.0, s.LONGEST), "mps2": _numbers(-5.0, 5.0)},
        ("at_s", "mps2"),
    ),
    "curvature": (
        s.CURVATURE_KEYS,
        {"at_m": _numbers(0.0, s.FARTHEST), "per_m": _numbers(-0.05, 0.05)},
        ("at_m", "per_m"),
    ),
}
ONE_SPEED = ("host", "lead")  # exactly one speed key, in any unit


def schema() -> dict[str, Any]:
    parts = {name: _object(name) for name in SECTIONS}
    whole = parts.pop("scenario")
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": s.SCHEMA,
        **whole,
        "definitions": parts,
    }


def _object(name: str) -> dict[str, Any]:
    meanings, types, needed = SECTIONS[name]
    properties = {key: {**types[key], "description": meaning} for key, meaning in meanings.items()}
    part = {
        "type": "object",
        "properties": properties,
        "required": list(needed),
        "additionalProperties": False,
    }
    if name in ONE_SPEED:
        part["oneOf"] = [{"required": [key]} for key in _SPEED]
    return part


def page() -> str:
    lines = [TEXT]
    for name, (meanings, types, needed) in SECTIONS.items():
        lines += [f"## {'The file' if name == 'scenario' else name.capitalize()}\n"]
        if name in ONE_SPEED:
            lines += ["Give exactly one of the speeds.\n"]
        lines += ["| key | type | | meaning |", "|---|---|---|---|"]
        for key, meaning in meanings.items():
            lines += [
                f"| `{key}` | {_words(types[key])} | {'required' if key in needed else ''} | {meaning} |"
            ]
        lines += [""]
    return "\n".join(lines).rstrip() + "\n"


def _words(value: dict[str, Any]) -> str:
    if "$ref" in value:
        name = value["$ref"].rpartition("/")[2]
        return f"[{name}](#{name})"
    if "anyOf" in value:
        return " or ".join(map(_words, value["anyOf"]))
    if "enum" in value:
        return " or ".join(f"`{word}`" for word in value["enum"])
    if "const" in value:
        return f"`{value['const']}`"
    if value["type"] == "array":
        return f"list of {_words(value['items'])}"
    if value["type"] == "number":
        return f"number ({value['minimum']:g} to {value['maximum']:g})"
    return "text"


def main() -> None:
    parser = argparse.ArgumentParser(description="Write the reference of scenario files.")
    parser.add_argument("--out", type=Path, default=Path("docs/reference"))
    out = parser.parse_args().out
    (out / "schemas").mkdir(parents=True, exist_ok=True)
    (out / "scenario.md").write_text(page(), encoding="utf-8")
    text = json.dumps(schema(), indent=1, ensure_ascii=False)
    (out / "schemas" / "scenario.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
