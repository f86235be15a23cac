"""Warnings about faults without effect and about values that no spec declares."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json


@pytest.mark.parametrize(
    ("words", "warnings"),
    [
        (["sensor/lane", "--value", "0"], ["the value changes nothing: sensor/lane/shifted 0 m"]),
        (
            ["sensor/distance", "--value", "500"],
            [
                "value 500 is outside the range that the spec declares: sensor/distance/longer, 1 to 65 m; "
                "sensor/distance/nearer, 400 to 459 m"
            ],
        ),
        (
            ["sensor/distance", "--variant", "longer", "--value", "0"],
            [
                "the value changes nothing: sensor/distance/longer 0 m",
                "value 0 is outside the range that the spec declares: sensor/distance/longer, 1 to 65 m",
            ],
        ),
        (["sensor/lane", "--value", "2.5"], []),
        (["sensor/lane"], []),
    ],
)
def test_a_chosen_value_without_effect_gets_a_warning(
    cli: Cli, root: Path, words: list[str], warnings: list[str]
) -> None:
    answer = cli("diff", *words)
    assert answer.code == 0
    assert "+" in answer.out
    lines = [line for line in answer.err.splitlines() if line.startswith("warning")]
    assert lines == [f"warning: {text}" for text in warnings]


def test_a_plan_warns_of_values_without_effect(cli: Cli, root: Path) -> None:
    """With a lower bound, an offset of 0 can have an effect."""
    spec = root / "fault_library" / "faults" / "sensor" / "lane.yaml"
    listed = spec.read_text().replace(
        "reals_from: {first: [0.0, 0.1], step: 0.8, last: [2.4, 2.5]}", "values: [0, 1]"
    )
    spec.write_text(listed.replace("        decimals: 2\n", ""))
    words = ("plan", "toy", "--only", 'fault_type == "lane"', "--out")
    answer = cli(*words, "p")
    assert answer.code == 0
    assert "warning: the value changes nothing in 3 of 6 experiments: sensor/lane/shifted 0 m" in answer.err
    spec.write_text(spec.read_text().replace("{by_m: offset}", "{by_m: offset, low_m: 0}"))
    assert "warning" not in cli(*words, "q").err


@pytest.mark.slow
def test_a_run_warns_of_triggers_that_never_fire(cli: Cli, root: Path) -> None:
    campaign = root / "fault_library" / "campaigns" / "small.yaml"
    text = campaign.read_text().replace("methods: [guided, random]", "methods: [guided]")
    campaign.write_text(text.replace("table: near_far", "list: [{at_s: 50}, {at_s: 2}]"))
    answer = cli("run", "small", "--out", "r", "-n", "0", "--limit", "4")
    assert answer.code == 0
    told = answer.err.index("warning: the scenario ends before the time of 2 of 4 experiments, which")
    assert answer.err.index("golden runs 0/") < told < answer.err.index("\nexperiments ")
