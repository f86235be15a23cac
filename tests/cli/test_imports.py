"""`import` makes a library of other people's fault files that later commands use."""

import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json
FILES = Path(__file__).parents[1] / "fixtures" / "uva"


def test_import_says_what_became_of_the_lines(cli: Cli, nowhere: Path) -> None:
    answer = cli("import", "uva", FILES, "--out", "authors")
    assert answer.code == 0
    assert answer.out.startswith("authors: 11 lines in 5 files: 9 imported, 1 equal, 1 refused\n")
    assert "refused: fault_library/scenario_1.txt:5: a statement that is not understood" in answer.out
    assert (nowhere / "authors" / "imported.csv").is_file()


def test_the_new_library_has_no_problem_and_can_be_planned(
    cli: Cli, nowhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cli("import", "uva", FILES, "--out", "authors")
    monkeypatch.chdir(nowhere / "authors")
    assert cli("check").code == 0
    plan = cli("plan", "uva_hwt_from_0_and_hwt_to_1_5", "--out", "runs/plan")
    assert plan.code == 0 and re.search(r"^total +5$", plan.out, re.MULTILINE)


def test_one_of_a_pair_is_tried_by_its_first_value(
    cli: Cli, nowhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cli("import", "uva", FILES, "--out", "authors")
    monkeypatch.chdir(nowhere / "authors")
    answer = cli("diff", "vision_output/uva_15", "--value", "0.125", "--reading", "as_coded")
    assert answer.code == 0
    assert "+ 0.125 * (_fi.steps() - 1)" in answer.out and "+ 0.5 * (_fi.steps() - 1)" in answer.out
    refused = cli("diff", "vision_output/uva_15", "--value", "0.2", "--reading", "as_coded")
    assert refused.code == 2
    assert "one of -0.25, 0.125, because the values come in pairs" in refused.err


def test_json_has_every_line(cli: Cli, nowhere: Path) -> None:
    document = cli("import", "uva", FILES, "--out", "authors", "--json").json
    assert document["counts"] == {"imported": 9, "equal": 1, "refused": 1}
    assert len(document["entries"]) == 11


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("uva", "missing"), "no such folder"),
        (("uva", "."), "no fault files"),
        (("open_scenario", "."), "no library importer 'open_scenario'"),
    ],
)
def test_wrong_input_writes_nothing(cli: Cli, nowhere: Path, words: tuple[str, ...], said: str) -> None:
    answer = cli("import", *words, "--out", "authors")
    assert answer.code == 2 and said in answer.err and "Traceback" not in answer.err
    assert not (nowhere / "authors").exists()


def test_a_folder_with_files_is_an_error_that_names_the_option(cli: Cli, nowhere: Path) -> None:
    (nowhere / "authors").mkdir()
    (nowhere / "authors" / "thesis.tex").touch()
    answer = cli("import", "uva", FILES, "--out", "authors")
    assert answer.code == 2 and "authors: not empty (thesis.tex)" in answer.err
    assert "choose another --out" in answer.err
    assert "choose another DIR" in cli("init", "authors").err


def test_a_cut_file_is_an_error_with_its_line(cli: Cli, nowhere: Path) -> None:
    path = shutil.copytree(FILES, nowhere / "files") / "fault_library" / "scenario_1.txt"
    path.write_text(path.read_text().replace("cases: 3", "cases: 4"))
    answer = cli("import", "uva", "files", "--out", "authors")
    assert answer.code == 2
    assert "files/fault_library/scenario_1.txt:6: 3 faults" in answer.err
