"""`mutator plan` on the toy target."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json


def test_plan_writes_the_plan_and_runs_nothing(cli: Cli, root: Path) -> None:
    answer = cli("plan", "toy", "--out", "p", "--only", 'fault_type == "distance"', "-n", "4")
    assert answer.code == 0
    for wanted in ("sensor/distance", "guided", "random", "total", "with 4 workers", "MB of disk"):
        assert wanted in answer.out
    assert "run it: mutator run toy --out p -n 4" in answer.out
    assert "sensor/lane" not in answer.out
    assert (Path("p") / "plan.csv").read_text().startswith("experiment_id,")
    assert not (Path("p") / "records").exists()


def test_a_plan_is_the_same_each_time(cli: Cli, root: Path) -> None:
    one, two = (cli("plan", "toy", "--out", out, "--json").json for out in "ab")
    other = cli("plan", "toy", "--out", "c", "--seed", "8", "--json").json
    assert one["digest"] == two["digest"] != other["digest"]
    assert one["experiments"] == sum(group["experiments"] for group in one["groups"]) == 24
    assert one["cost"]["wall_s"] > 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["toys", "--out", "p"], "toy"),
        (["toy", "--out", "p", "--only", "fault_typ == 'x'"], "fault_type"),
        (["toy", "--out", "p", "--only", "value >"], "value >"),
        (["toy", "--out", "p", "--exclude", "value >= 0 or trigger != ''"], "no experiment is left"),
        (["toy", "--out", "p", "--reading", "as_read"], "as_described"),
        (["toy", "--out", "full"], "not empty"),
        (["toy", "--out", "p", "--limit", "10", "--proportional"], "a multiple of 2, 12 or more"),
        (["toy", "--out", "p", "--proportional"], "the number of experiments to keep"),
    ],
)
def test_an_invalid_plan_is_refused(cli: Cli, root: Path, words: list[str], said: str) -> None:
    Path("full").mkdir()
    Path("full/mine.txt").touch()
    answer = cli("plan", *words)
    assert answer.code == 2
    assert said in answer.err
    assert "Traceback" not in answer.err
    assert not Path("p/run.json").exists()


EXPLORED = """\
schema: campaign/1
name: explored
about: How wrong the lane sensor and the distance may be.
target: toycar
scenarios: [A]
faults: [{spec: sensor/lane/shifted}, {spec: sensor/silence/no_data}]
explore: {starts: [1], points: 4, longest_s: 3, search: 10, validation: 5}
seed: 3
canary: {spec: sensor/lane/shifted, scenario: A, hazard: H3, at_s: 1.0}
"""


def test_a_campaign_that_explores_has_planes(cli: Cli, root: Path) -> None:
    """And the most runs; nothing is frozen, and choices among experiments are refused."""
    (root / "fault_library/campaigns/explored.yaml").write_text(EXPLORED)
    answer = cli("plan", "explored", "--out", "run")
    assert answer.code == 0, answer.err
    assert "2 planes, at most 19 runs" in answer.out and "run it: mutator run explored" in answer.out
    facts = cli("plan", "explored", "--out", "run", "--json").json
    assert [plane["cells"] for plane in facts["planes"]] == [16, 4]
    assert cli("plan", "explored", "--out", "run", "--limit", "3").code == 2
    assert not Path("run").exists()
