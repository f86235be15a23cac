"""`try` and `generate`, which need no run folder, on the toy target."""

import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from mutator.cli import experiment_printing
from mutator.cli.terminal_output import Terminal
from mutator.model import Record
from mutator.outcomes.verdict_rules import reaction_time
from mutator.workspace import Workspace

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json


def test_try_needs_no_campaign(cli: Cli, root: Path) -> None:
    shutil.move(root / "fault_library/faults/sensor/silence.yaml", "own.yaml")
    answer = cli("try", "own.yaml", "--scenario", "A", "--trigger", "2")
    assert answer.code == 0
    for wanted in ("sensor/silence/no_data", "t >= 2.0", "if not _fi.active", "verdict: "):
        assert wanted in answer.out
    assert "method" not in answer.out


def test_try_draws_a_plot_only_if_asked(cli: Cli, root: Path) -> None:
    """A plot costs more time than the two runs; one of an earlier trial must not stay next to new traces."""
    words = ("try", "sensor/lane", "-s", "A", "--trigger", "1")
    [line] = [line for line in cli(*words, "--plot").out.splitlines() if line.startswith("plot: ")]
    plot = Path(line.removeprefix("plot: "))
    assert plot.is_file()
    assert f"traces: {plot.parent} (--plot plots them)" in cli(*words).out
    assert not plot.exists()
    assert cli(*words, "--json").json["plot"] is None


@pytest.mark.parametrize(
    "words",
    [
        ("try", "sensor/lane", "-s", "A", "--trigger", "1"),
        ("diff", "sensor/lane"),
    ],
)
def test_try_and_diff_load_neither_pandas_nor_matplotlib(root: Path, words: tuple[str, ...]) -> None:
    code = (
        "import sys; from mutator.cli.app import main; code = main(sys.argv[1:]); print(code, *sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=True)
    exit_code, *modules = done.stdout.splitlines()[-1].split()
    assert exit_code == "0"
    assert {"pandas", "matplotlib"}.isdisjoint(modules)


def test_try_says_whether_an_alert_came_before_the_hazard(cli: Cli, root: Path) -> None:
    lane = cli("try", "sensor/lane", "-s", "A", "--value", "2.4", "--trigger", "1").out
    assert "hazard H3" in lane
    assert "no alert before the hazard" in lane.splitlines()


@pytest.mark.parametrize(
    ("alert", "hazard", "note"),
    [
        (2.0, 3.0, ""),
        (3.0, 3.0, "no alert before the hazard"),
        (4.0, 3.0, "no alert before the hazard"),
        (None, 3.0, "no alert before the hazard"),
        (2.0, None, ""),
        (None, None, "no alert"),
    ],
)
def test_the_note_on_alerts_agrees_with_the_reaction_time(
    toycar: Workspace, record: Callable[..., Record], alert: float | None, hazard: float | None, note: str
) -> None:
    made = replace(
        record(),
        alerts=() if alert is None else (("chime", alert),),
        hazards=() if hazard is None else (("H3", hazard),),
    )
    reaction = reaction_time(made.hazards, made.alerts)
    assert experiment_printing._missing_alert_note(made, toycar.manifest("toycar"), reaction) == note


@pytest.mark.parametrize("width", range(20, 60))
def test_a_sentence_is_not_folded_between_a_number_and_its_unit(
    record: Callable[..., Record], width: int, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    """In a pipe of any width, `9.5 s` stays on one line."""
    monkeypatch.setenv("COLUMNS", str(width))
    sentence = "The car slows to 11.7 m/s and touches the lead 9.5 s later at 20 mph."
    result = SimpleNamespace(
        record=record(), sentence=sentence, verdict={"reaction_time_s": None}, _manifest=lambda: None
    )
    experiment_printing.print_ending_in_words(Terminal(), cast(Any, result))
    out = capsys.readouterr().out
    assert sentence in " ".join(out.split())
    assert all(value in out for value in ("11.7 m/s", "9.5 s", "20 mph"))


def test_try_reports_hazards_of_the_fault_free_run(cli: Cli, root: Path) -> None:
    words = ("try", "sensor/lane", "-s", "A", "--trigger", "1")
    said = "the fault-free run also reaches"
    assert said not in cli(*words).out
    assert cli(*words, "--json").json["golden_hazards_s"] == {}
    scenario = root / "fault_library" / "scenarios" / "A.yaml"
    scenario.write_text(scenario.read_text().replace("\nspeed: 20", "\nspeed: 36"))
    assert [line for line in cli(*words).out.splitlines() if said in line] == [
        "the fault-free run also reaches TOO_FAST at 0.00 s: the fault is not necessarily the cause"
    ]
    assert cli(*words, "--json").json["golden_hazards_s"] == {"TOO_FAST": 0.0}


def test_try_prints_json(cli: Cli, root: Path) -> None:
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
def test_a_wrong_scenario_or_value_lists_the_choices(
    cli: Cli, root: Path, words: list[str], said: str
) -> None:
    answer = cli("try", *words)
    assert answer.code == 2
    assert said in answer.err


def test_generate_writes_each_mutant_of_a_campaign_once(cli: Cli, root: Path) -> None:
    """Scenarios can share a mutant."""
    index = cli("generate", "--campaign", "toy", "--out", "m", "--json").json
    assert 0 < len(index) <= 24
    assert len({line["mutant_id"] for line in index}) == len(index)
    assert all((Path("m") / line["patch"]).is_file() for line in index)
