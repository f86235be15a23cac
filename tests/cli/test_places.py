"""The `places` command."""

import json
from collections.abc import Callable
from typing import Any

import pytest

from mutator.workspace import Workspace

Cli = Callable[..., Any]


def place(toy: Workspace) -> tuple[str, ...]:
    return ("--library", str(toy.library), "--templates", str(toy.templates))


def test_places_are_listed_with_line_anchor_and_models(cli: Cli, toy: Workspace) -> None:
    answer = cli("places", "toycar/sensing.py::Sensor.sense", *place(toy))
    assert answer.code == 0
    assert "{function: Sensor.sense, after_assign: gap}" in answer.out
    assert "offset" in answer.out
    found = json.loads(cli("places", "toycar/sensing.py", "--json", *place(toy)).out)
    assert {"file": "toycar/sensing.py", "function": "Sensor.sense", "value": "world.gap"} in [
        one["at"] for one in found
    ] or any(one["at"].get("assigned_value") == "gap" for one in found)
    assert all(one["models"] and one["line"] > 0 for one in found)


@pytest.mark.parametrize(
    ("where", "words"),
    [
        ("toycar/sensin.py", "no Python file 'toycar/sensin.py' in target toycar"),
        ("toycar/world.py", "no fault may be injected into file"),
        ("toycar/sensing.py::Sensor.sens", "no function 'Sensor.sens'"),
    ],
)
def test_a_missing_or_forbidden_file_is_refused(cli: Cli, toy: Workspace, where: str, words: str) -> None:
    answer = cli("places", where, *place(toy))
    assert answer.code == 2
    assert words in answer.err
