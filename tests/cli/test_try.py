"""`try` and `generate`, which need no run folder, on the toy target."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json


def test_try_needs_no_campaign(cli: Cli, root: Path) -> None:
    """`try` takes a fault from any file and shows diff, verdict, plot and traces.

    It does not write to the library.
    """
    shutil.move(root / "fault_library/faults/sensor/silence.yaml", "own.yaml")
    answer = cli("try", "own.yaml", "--scenario", "A", "--trigger", "2")
    assert answer.code == 0
    for wanted in ("sensor/silence/no_data", "t >= 2.0", "if not _fi.active", "verdict: "):
        assert wanted in answer.out
    assert "method" not in answer.out
    [plot] = [line.removeprefix("plot: ") for line in answer.out.splitlines() if line.startswith("plot: ")]
    assert Path(plot).is_file()


def test_try_says_whether_an_alert_came_before_the_hazard(cli: Cli, root: Path) -> None:
    lane = cli("try", "sensor/lane", "-s", "A", "--value", "2.4", "--trigger", "1").out
    assert "hazard H3" in lane
    assert "no alert before the hazard" in lane.splitlines()


def test_try_tells_of_hazards_without_the_fault(cli: Cli, root: Path) -> None:
    """If the fault-free run reaches a hazard, one line says so, and so does the JSON."""
    words = ("try", "sensor/lane", "-s", "A", "--trigger", "1")
    said = "the fault-free run also reaches"
    assert said not in cli(*words).out
    assert cli(*words, "--json").json["golden_hazards_s"] == {}
    scenario = root / "fault_library" / "scenarios" / "A.yaml"
    scenario.write_text(scenario.read_text().replace("\nspeed: 20", "\nspeed: 36"))
    assert [line for line in cli(*words).out.splitlines() if said in line] == [
        "the fault-free run also reaches TOO_FAST at 0.00 s: the fault may not be the cause"
    ]
    assert cli(*words, "--json").json["golden_hazards_s"] == {"TOO_FAST": 0.0}


def test_try_as_json(cli: Cli, root: Path) -> None:
    """JSON has verdict, times and paths. The same fault always has the same id."""
    words = ("try", "sensor/lane", "-s", "A", "--value", "2.4", "--trigger", "1", "--json")
    one, two = cli(*words).json, cli(*words).json
    assert one == two
    assert one["fault"] == "sensor/lane/shifted 2.4 m"
    assert one["outcome"] == "hazard"
    assert one["hazards_s"]["H3"] > one["activated_s"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["sensor/distance", "-s", "Z"], "one of A, B"),
        (["sensor/distance"], "--scenario"),
        (["sensor/distance", "-s", "A", "--value", "many"], "--value"),
    ],
)
def test_what_cannot_be_tried_is_answered(cli: Cli, root: Path, words: list[str], said: str) -> None:
    """A wrong scenario or value exits with 2 and lists the choices."""
    answer = cli("try", *words)
    assert answer.code == 2
    assert said in answer.err


def test_generate_gives_the_mutants_of_a_campaign(cli: Cli, root: Path) -> None:
    """Each mutant of the plan is written once, even if several scenarios share it."""
    index = cli("generate", "--campaign", "toy", "--out", "m", "--json").json
    assert 0 < len(index) <= 24
    assert len({line["mutant_id"] for line in index}) == len(index)
    assert all((Path("m") / line["patch"]).is_file() for line in index)
