"""The `stpa` command, and hazard analyses in `check`."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

CLONE = Path(__file__).parents[2]
Cli = Callable[..., Any]


def test_the_analysis_is_printed_and_drawn(cli: Cli, nowhere: Path) -> None:
    answer = cli("--root", CLONE, "stpa", "--svg", "structure.svg")
    assert answer.code == 0, answer.err
    for wanted in (
        "accidents (3)",
        "hazards (4)",
        "hwt > 2.0 and rs > 0.0",
        "the contexts cover everything exactly once: proved in 9 cells",
        "unsafe control actions (15)",
        "vision_output/camera_unavailable",
        "none: A driver is a defence",
        "control structure: structure.svg",
        "all well: 23 causal factors, 27 fault specs",
    ):
        assert wanted in answer.out
    assert (nowhere / "structure.svg").read_text().startswith("<svg ")


def test_the_analysis_is_printed_as_json(cli: Cli, nowhere: Path) -> None:
    answer = cli("--root", CLONE, "stpa", "--json")
    assert answer.json["problems"] == []
    assert answer.json["hazards"]["H3"]["leads_to"] == ["A1", "A3"]
    assert answer.json["context_tables"]["steer"]["contexts"][0]["condition"] == "v_ego < 0.3"
    assert answer.json["unsafe_control_actions"]["UCA7"]["category"] == "provided"
    assert answer.json["causal_factors"]["CF1"]["faults"] == ["radar/chaff"]
    assert answer.json["control_structure"]["links"]["gas"]["from"] == "acc"


@pytest.fixture
def library(tmp_path: Path) -> Path:
    library = tmp_path / "fault_library"
    shutil.copytree(CLONE / "fault_library", library)
    (tmp_path / "target").symlink_to(CLONE / "target")
    return library


def test_a_spec_that_no_causal_factor_needs_exits_with_1(cli: Cli, library: Path, nowhere: Path) -> None:
    factors = library / "stpa" / "causal_factors.yaml"
    factors.write_text(factors.read_text().replace(", vision_weather/lens_mud", ""))
    answer = cli("--root", CLONE, "--library", library, "stpa")
    assert answer.code == 1
    assert "lens_mud.yaml:1: fault spec 'vision_weather/lens_mud' belongs to no causal factor" in answer.out
    assert "name it in stpa/causal_factors.yaml" in answer.out
    assert answer.out.splitlines()[-1] == "1 problem"


def test_an_unreadable_analysis_exits_with_2(cli: Cli, library: Path, nowhere: Path) -> None:
    factors = library / "stpa" / "causal_factors.yaml"
    factors.write_text(factors.read_text().replace("[UCA2,", "[UCA22,", 1))
    answer = cli("--root", CLONE, "--library", library, "stpa")
    assert answer.code == 2
    assert "causal_factors.yaml:10: unsafe control action 'UCA22'" in answer.err


def test_the_error_names_a_missing_file_of_the_analysis(cli: Cli, root: Path) -> None:
    answer = cli("stpa")
    assert answer.code == 2
    assert "no control_structure.yaml" in answer.err
    assert cli("check").code == 0


def test_check_covers_the_analysis(cli: Cli, library: Path, nowhere: Path) -> None:
    factors = library / "stpa" / "causal_factors.yaml"
    factors.write_text(factors.read_text().replace("[vision_input/blur]", "[vision_input/blurr]"))
    answer = cli("--root", CLONE, "--library", library, "check")
    assert answer.code == 1
    assert "fault spec 'vision_input/blurr'" in answer.out
    assert "blur.yaml:1: fault spec 'vision_input/blur' belongs to no causal factor" in answer.out


@pytest.mark.parametrize(
    ("new", "said"),
    [
        ("when: hwt > 3", "near_far.yaml:6: no context holds at 2.0 < hwt < 3.0"),
        ("when: hwt >= near_s", "near_far.yaml:13: context 'far' overlaps 'near' at hwt = 2.0"),
        ("when: gap > near_s", "near_far.yaml:13: unknown name 'gap'"),
    ],
)
def test_a_campaign_needs_correct_context_tables(cli: Cli, root: Path, new: str, said: str) -> None:
    table = root / "fault_library" / "stpa" / "contexts" / "near_far.yaml"
    table.write_text(table.read_text().replace("when: hwt > near_s", new))
    answer = cli("plan", "toy", "--out", "plan")
    assert answer.code == 2
    assert said in answer.err
    assert not Path("plan").exists()


def test_a_diagram_that_cannot_be_written_is_reported(cli: Cli, nowhere: Path) -> None:
    answer = cli("--root", CLONE, "stpa", "--svg", "no/such/structure.svg")
    assert answer.code == 2
    assert "no/such/structure.svg: cannot write the file" in answer.err
