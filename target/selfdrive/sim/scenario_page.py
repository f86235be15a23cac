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

PAGE_INTRODUCTION = f"""\
# Scenarios

<!-- Written by `python -m selfdrive.sim.scenario_page`; do not edit by hand. -->

A scenario file in `fault_library/scenarios/` describes the controlled car (the host), the lead, the driver
and the road. Only the target reads scenarios; this page lists the keys that the shipped target accepts.
[Add a scenario](../how-to/add-a-scenario.md) has an example, and
[an editor can check the files](../how-to/edit-with-completion.md).

The key of a number ends in its unit. Times are multiples of {DT_CTRL:g} s. An unknown key is an error
with file and line.
"""


def _number_type(low: float, high: float) -> dict[str, Any]:
    return {"type": "number", "minimum": low, "maximum": high}


def _numbers_type(low: float, high: float) -> dict[str, Any]:
    return {"type": "array", "items": _number_type(low, high), "minItems": 1}


def _choice_type(words: Any) -> dict[str, Any]:
    return {"enum": list(words)}


_TEXT_TYPE = {"type": "string"}
_SPEED_TYPES = dict.fromkeys((f"speed_{unit}" for unit in s.SPEED_UNITS), _number_type(0.0, s.MOST_SPEED))
_SPEED_OR_LIST_TYPES = {
    key: {"anyOf": [speed, _numbers_type(0.0, s.MOST_SPEED)]} for key, speed in _SPEED_TYPES.items()
}
_TIME_TYPE = _number_type(0.0, s.MOST_SECONDS)

# By section heading: the keys with their meanings, their types, and the required keys.
SECTIONS: dict[str, tuple[dict[str, str], dict[str, dict[str, Any]], tuple[str, ...]]] = {
    "scenario": (
        s.SCENARIO_KEYS,
        {
            "schema": {"const": s.SCHEMA},
            "name": _TEXT_TYPE,
            "title": _TEXT_TYPE,
            "duration_s": _number_type(DT_CTRL, s.MOST_SECONDS),
            "host": {"$ref": "#/definitions/host"},
            "lead": {"$ref": "#/definitions/lead"},
            "buttons": {"type": "array", "items": {"$ref": "#/definitions/button"}},
            "plant": _choice_type(s.PLANTS),
            "road": {"$ref": "#/definitions/road"},
        },
        ("schema", "name", "title", "duration_s", "host"),
    ),
    "host": (s.HOST_KEYS, {**_SPEED_TYPES, "lateral_offset_m": _number_type(-10.0, 10.0)}, ()),
    "lead": (
        s.LEAD_KEYS,
        {
            "gap_m": _number_type(0.0, s.MOST_DISTANCE),
            **_SPEED_OR_LIST_TYPES,
            "at_s": _numbers_type(0.0, s.MOST_SECONDS),
        },
        ("gap_m",),
    ),
    "button": (
        s.BUTTON_KEYS,
        {"button": _choice_type(s.BUTTON_CODES), "press_s": _TIME_TYPE, "release_s": _TIME_TYPE},
        ("button", "press_s", "release_s"),
    ),
    "road": (
        s.ROAD_KEYS,
        {"grade": {"$ref": "#/definitions/grade"}, "curvature": {"$ref": "#/definitions/curvature"}},
        (),
    ),
    "grade": (
        s.GRADE_KEYS,
        {"at_s": _numbers_type(0.0, s.MOST_SECONDS), "mps2": _numbers_type(-5.0, 5.0)},
        ("at_s", "mps2"),
    ),
    "curvature": (
        s.CURVATURE_KEYS,
        {"at_m": _numbers_type(0.0, s.MOST_DISTANCE), "per_m": _numbers_type(-0.05, 0.05)},
        ("at_m", "per_m"),
    ),
}
SECTIONS_WITH_ONE_SPEED = ("host", "lead")  # exactly one speed key, in any unit


def scenario_json_schema() -> dict[str, Any]:
    parts = {name: _section_schema(name) for name in SECTIONS}
    whole = parts.pop("scenario")
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": s.SCHEMA,
        **whole,
        "definitions": parts,
    }


def _section_schema(name: str) -> dict[str, Any]:
    meanings, types, needed = SECTIONS[name]
    properties = {key: {**types[key], "description": meaning} for key, meaning in meanings.items()}
    part = {
        "type": "object",
        "properties": properties,
        "required": list(needed),
        "additionalProperties": False,
    }
    if name in SECTIONS_WITH_ONE_SPEED:
        part["oneOf"] = [{"required": [key]} for key in _SPEED_TYPES]
    return part


def render_scenario_page() -> str:
    lines = [PAGE_INTRODUCTION]
    for name, (meanings, types, needed) in SECTIONS.items():
        lines += [f"## {'The file' if name == 'scenario' else name.capitalize()}\n"]
        if name in SECTIONS_WITH_ONE_SPEED:
            lines += ["Give exactly one of the speeds.\n"]
        lines += ["| key | type | | meaning |", "|---|---|---|---|"]
        for key, meaning in meanings.items():
            required = "required" if key in needed else ""
            lines += [f"| `{key}` | {_describe_type(types[key])} | {required} | {meaning} |"]
        lines += [""]
    return "\n".join(lines).rstrip() + "\n"


def _describe_type(value: dict[str, Any]) -> str:
    if "$ref" in value:
        name = value["$ref"].rpartition("/")[2]
        return f"[{name}](#{name})"
    if "anyOf" in value:
        return " or ".join(map(_describe_type, value["anyOf"]))
    if "enum" in value:
        return " or ".join(f"`{word}`" for word in value["enum"])
    if "const" in value:
        return f"`{value['const']}`"
    if value["type"] == "array":
        return f"list of {_describe_type(value['items'])}"
    if value["type"] == "number":
        return f"number ({value['minimum']:g} to {value['maximum']:g})"
    return "text"


def main() -> None:
    parser = argparse.ArgumentParser(description="Write the reference of scenario files.")
    parser.add_argument("--out", type=Path, default=Path("docs/reference"))
    out = parser.parse_args().out
    (out / "schemas").mkdir(parents=True, exist_ok=True)
    (out / "scenario.md").write_text(render_scenario_page(), encoding="utf-8")
    text = json.dumps(scenario_json_schema(), indent=1, ensure_ascii=False)
    (out / "schemas" / "scenario.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
