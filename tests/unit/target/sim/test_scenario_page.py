"""The reference of scenario files agrees with the parser."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml
from selfdrive.common.errors import ConfigError
from selfdrive.sim import scenario_page
from selfdrive.sim.scenario import parse_scenario

CLONE = Path(__file__).parents[4]
REFERENCE = CLONE / "docs" / "reference"
SCENARIOS = sorted((CLONE / "fault_library" / "scenarios").glob("*.yaml"))


def accepted(data: dict[str, Any]) -> tuple[bool, bool]:
    try:
        parse_scenario(yaml.safe_dump(data), "test", "")
    except ConfigError:
        parsed = False
    else:
        parsed = True
    return jsonschema.Draft7Validator(scenario_page.scenario_json_schema()).is_valid(data), parsed


def test_page_and_schema_are_up_to_date() -> None:
    remedy = "run: python -m selfdrive.sim.scenario_page"
    assert (REFERENCE / "scenario.md").read_text() == scenario_page.render_scenario_page(), remedy
    assert (
        json.loads((REFERENCE / "schemas" / "scenario.json").read_text())
        == scenario_page.scenario_json_schema()
    ), remedy


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_the_library_follows_the_schema(path: Path) -> None:
    assert accepted(yaml.safe_load(path.read_text())) == (True, True)


def _sections(data: dict[str, Any]) -> dict[str, dict[str, Any]]:
    road = data["road"]
    return {"scenario": data, "host": data["host"], "lead": data["lead"], "button": data["buttons"][0]} | {
        "road": road,
        "grade": road["grade"],
        "curvature": road["curvature"],
    }


def full() -> dict[str, Any]:
    return {
        "schema": "scenario/1",
        "name": "full",
        "title": "Everything",
        "duration_s": 10,
        "host": {"speed_mps": 20, "lateral_offset_m": 0.1},
        "lead": {"gap_m": 50, "speed_kph": [50, 60], "at_s": [0, 5]},
        "buttons": [{"button": "decel_set", "press_s": 1.2, "release_s": 1.3}],
        "plant": "standard",
        "road": {"grade": {"at_s": [0], "mps2": [0]}, "curvature": {"at_m": [0], "per_m": [0]}},
    }


def test_a_scenario_with_all_keys_is_accepted() -> None:
    assert accepted(full()) == (True, True)


@pytest.mark.parametrize("name", scenario_page.SECTIONS)
def test_schema_and_parser_agree_on_keys_and_bounds(name: str) -> None:
    _, types, needed = scenario_page.SECTIONS[name]
    breaks: list[tuple[str, Any]] = [(key, None) for key in needed] + [("unheard_of", 1)]
    for key, kind in types.items():
        for bound, step in (("minimum", -1e-3), ("maximum", 1e-3)):
            if bound in kind:
                breaks.append((key, kind[bound] + step))
            if bound in kind.get("items", {}):
                breaks.append((key, [kind["items"][bound] + step]))
        if "enum" in kind or "const" in kind:
            breaks.append((key, "no_such_word"))
        if kind.get("type") in ("number", "array"):
            breaks.append((key, "some"))
    for key, value in breaks:
        data = full()
        section = _sections(data)[name]
        if value is None:
            del section[key]
        else:
            section[key] = value
        assert accepted(data) == (False, False), (key, value)
