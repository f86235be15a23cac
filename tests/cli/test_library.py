"""`list`, `check`, `doctor`."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Cli = Callable[..., Any]  # runs `mutator WORDS...`, gives code, out, err, json


def test_list_shows_every_kind(cli: Cli, root: Path) -> None:
    """All that the library holds is listed under its kind, with counts."""
    answer = cli("list")
    assert answer.code == 0
    for wanted in ("specs (3)", "sensor/distance", "scenarios (2)", "campaigns (", "models (", "offset"):
        assert wanted in answer.out
    assert "triggers (2)" in answer.out
    assert "hwt <= 2.0" in answer.out


def test_list_as_json_is_the_same_for_programs(cli: Cli, root: Path) -> None:
    """`--json` prints one document with one entry for each kind, or only the kind asked for."""
    listed = cli("list", "--json").json
    assert set(listed) == {"specs", "scenarios", "campaigns", "models", "triggers", "targets"}
    assert [(s["name"], s["faults"]) for s in listed["specs"]] == [
        ("sensor/distance", 6),
        ("sensor/lane", 4),
        ("sensor/silence", 1),
    ]
    assert cli("list", "triggers", "--json").json == {"triggers": listed["triggers"]}
    assert all(one["about"] for one in listed["campaigns"])


def test_a_kind_that_is_none_is_answered(cli: Cli, root: Path) -> None:
    """The kinds there are, in words of ours alone."""
    answer = cli("list", "nothing")
    assert answer.code == 2
    assert "'nothing' is not one of 'specs', 'scenarios'" in answer.err
    assert "Value error" not in answer.err


def test_a_piped_table_has_no_control_characters(cli: Cli, root: Path) -> None:
    """What goes into a pipe is plain text: no colours, no box, no trailing blanks."""
    lines = cli("list").out.splitlines()
    assert all(line.isprintable() and line == line.rstrip() for line in lines)


def test_check_says_all_is_well(cli: Cli, root: Path) -> None:
    """A library that fits its target passes with 0 and the counts."""
    answer = cli("check")
    assert answer.code == 0
    assert "all well: 3 specs, 11 faults" in answer.out


def test_check_tells_each_problem_with_its_place(cli: Cli, root: Path) -> None:
    """An anchor that the target does not have fails the check with file and line."""
    spec = root / "fault_library" / "faults" / "sensor" / "distance.yaml"
    spec.write_text(spec.read_text().replace("after_assign: gap", "after_assign: pace"))
    answer = cli("check")
    assert answer.code == 1
    assert "distance.yaml:" in answer.out
    assert "pace" in answer.out
    problems = cli("check", "--json").json
    assert problems
    assert all(p["file"] == str(spec) and p["line"] for p in problems)


def test_doctor_is_content_with_this_machine(cli: Cli, root: Path) -> None:
    """On a machine that runs the tests, doctor finds nothing that fails."""
    answer = cli("doctor")
    assert answer.code == 0
    assert answer.out.endswith("ready\n")
    assert "target toycar" in answer.out


def test_doctor_without_library_fails_and_helps(
    cli: Cli, nowhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a library doctor still looks at the rest, says what to do, and exits with 1."""
    monkeypatch.setenv("MUTATOR_ROOT", str(nowhere / "gone"))
    answer = cli("doctor")
    assert answer.code == 1
    assert "MUTATOR_ROOT" in answer.out
    assert {f["name"]: f["level"] for f in cli("doctor", "--json").json}["library"] == "failed"
