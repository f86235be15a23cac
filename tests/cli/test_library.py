"""`list`, `check` and `doctor` report on the library and the machine."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json


def test_list_shows_every_kind(cli: Cli, root: Path) -> None:
    answer = cli("list")
    assert answer.code == 0
    for wanted in ("specs (3)", "sensor/distance", "scenarios (2)", "campaigns (", "models (", "offset"):
        assert wanted in answer.out
    assert "triggers (2)" in answer.out
    assert "hwt <= 2.0" in answer.out


def test_list_as_json_is_one_document(cli: Cli, root: Path) -> None:
    listed = cli("list", "--json").json
    kinds = {"specs", "scenarios", "families", "campaigns", "models", "triggers", "defences", "targets"}
    assert set(listed) == kinds
    assert [(s["name"], s["faults"]) for s in listed["specs"]] == [
        ("sensor/distance", 6),
        ("sensor/lane", 4),
        ("sensor/silence", 1),
    ]
    assert cli("list", "triggers", "--json").json == {"triggers": listed["triggers"]}
    assert all(one["about"] for one in listed["campaigns"])


def test_list_shows_defences(cli: Cli, root: Path) -> None:
    [brake, limit] = cli("list", "defences", "--json").json["defences"]
    assert [*brake] == ["name", "role", "kind", "model", "about"]
    assert limit["name"] == "pedal_limit"
    assert limit["role"] == "external_measure"
    assert "defences (2)" in cli("list").out


def test_an_unknown_kind_lists_the_known_ones(cli: Cli, root: Path) -> None:
    answer = cli("list", "nothing")
    assert answer.code == 2
    assert "'nothing' is not one of 'specs', 'scenarios'" in answer.err
    assert "Value error" not in answer.err


def test_a_piped_table_is_plain_text(cli: Cli, root: Path) -> None:
    lines = cli("list").out.splitlines()
    assert all(line.isprintable() and line == line.rstrip() for line in lines)


def test_check_succeeds_if_the_library_fits_its_target(cli: Cli, root: Path) -> None:
    answer = cli("check")
    assert answer.code == 0
    assert "no problem, 1 warning: 3 specs, 11 faults" in answer.out
    warning = (
        "observed values: no channel has the name d_rel or v_ego or v_lead, so nobody sees it become NaN"
    )
    assert warning in " ".join(answer.out.split())


def test_check_reports_a_missing_anchor_with_its_line(cli: Cli, root: Path) -> None:
    spec = root / "fault_library" / "faults" / "sensor" / "distance.yaml"
    spec.write_text(spec.read_text().replace("after_assign: gap", "after_assign: pace"))
    answer = cli("check")
    assert answer.code == 1
    assert "distance.yaml:" in answer.out
    assert "pace" in answer.out
    problems = cli("check", "--json").json["problems"]
    assert problems
    assert all(p["file"] == str(spec) and p["line"] for p in problems)


def test_check_and_doctor_report_a_thread(cli: Cli, root: Path) -> None:
    """A target with threads cannot use the fast engines."""
    go = root / "tree" / "toycar" / "go.py"
    thread = "threading.Thread(target=threading.Event().wait, name='poll', daemon=True).start()"
    go.write_text(go.read_text().replace("class Drive", f"import threading\n\n{thread}\n\n\nclass Drive"))
    answer = cli("check")
    assert answer.code == 0
    assert "fast engines: nothing can be forked: once it is loaded, it has 2 threads" in answer.out
    assert "besides the main one, 'poll'" in answer.out
    assert "`mutator check --drive` names the lines that start threads" in answer.out
    assert "no problem, 2 warnings: 3 specs" in answer.out
    levels = {f["name"]: (f["level"], f["found"]) for f in cli("doctor", "--json").json}
    level, found = levels["fast engines, toycar"]
    assert (level, "'poll'" in found) == ("warning", True)


def test_check_reports_an_unused_draw(cli: Cli, root: Path) -> None:
    spec = root / "fault_library" / "faults" / "sensor" / "lane.yaml"
    spec.write_text(spec.read_text().replace("by_m: offset", "by_m: 2.5"))
    answer = cli("check")
    assert answer.code == 0
    line = next(n for n, text in enumerate(spec.read_text().splitlines(), 1) if "offset_m:" in text)
    assert (
        f"lane.yaml:{line} sensor/lane/shifted draws 'offset', unused in reading as_described" in answer.out
    )


def test_check_drive_also_lists_passed_checks(cli: Cli, root: Path) -> None:
    answer = cli("check", "--drive", "--scenario", "A")
    assert answer.code == 0
    for name in ("golden A: the same bytes twice", "fast engines: ", "statements: ", "triggers: ", "canary "):
        assert f"\n{name}" in f"\n{answer.out}"
    assert "golden B" not in answer.out
    assert answer.out.endswith("no problem, 1 warning: 3 specs, 11 faults, in both readings\n")


def test_check_drive_names_the_line_that_reads_a_clock(cli: Cli, root: Path) -> None:
    driver = root / "tree" / "toycar" / "driver.py"
    text = driver.read_text().replace("class Driver", "import time\n\n\nclass Driver")
    driver.write_text(text.replace("return gas,", "return gas + time.time() * 1e-12,"))
    answer = cli("check", "--drive", "--scenario", "A")
    assert answer.code == 1
    line = driver.read_text()[: driver.read_text().index("time.time()")].count("\n") + 1
    assert f"toycar/driver.py:{line} in Driver.drive: time.time() reads the clock" in answer.out
    found = cli("check", "--drive", "--scenario", "A", "--json").json["findings"]
    (golden,) = (one for one in found if one["name"] == "golden A")
    assert (golden["level"], golden["places"][0]["line"]) == ("failed", line)


def test_check_with_a_scenario_needs_drive(cli: Cli, root: Path) -> None:
    assert "add --drive" in cli("check", "--scenario", "A").err
    assert cli("check", "--drive", "--scenario", "nowhere").code == 2


def test_doctor_accepts_this_machine(cli: Cli, root: Path) -> None:
    answer = cli("doctor")
    assert answer.code == 0
    assert answer.out.endswith("ready\n")
    assert "target toycar" in answer.out


def test_doctor_without_a_library_checks_the_rest(
    cli: Cli, nowhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUTATOR_ROOT", str(nowhere / "gone"))
    answer = cli("doctor")
    assert answer.code == 1
    assert "MUTATOR_ROOT" in answer.out
    assert {f["name"]: f["level"] for f in cli("doctor", "--json").json}["library"] == "failed"
