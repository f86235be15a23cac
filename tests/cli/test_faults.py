"""`diff` and `generate` show and write faults without running them."""

import csv
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.mutants.mutant_building import unsplice

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json


def test_diff_shows_one_diff_for_each_variant(cli: Cli, root: Path) -> None:
    answer = cli("diff", "sensor/distance")
    assert answer.code == 0
    headings = [line for line in answer.out.splitlines() if line.startswith("# ")]
    assert len(headings) == 2
    assert "sensor/distance/nearer" in answer.out
    assert "+++ b/toycar/_fi.py" not in answer.out
    assert "not shown: toycar/_fi.py" in answer.err


def test_a_given_value_is_used_exactly(cli: Cli, root: Path) -> None:
    answer = cli("diff", "sensor/distance", "--variant", "longer", "--value", "12.5")
    assert "sensor/distance/longer 12.5 m\n" in answer.out
    assert "gap = gap + 12.5  # fi:" in answer.out


def test_a_whole_diff_can_be_applied(cli: Cli, root: Path) -> None:
    answer = cli("diff", "sensor/silence", "--trigger", "near", "--patch")
    tree = root / "tree"
    subprocess.run(["patch", "-p1", "-s"], input=answer.out, text=True, cwd=tree, check=True)
    assert "return hwt <= 2.0" in (tree / "toycar" / "_fi.py").read_text()


def test_a_spec_file_need_not_be_in_the_library(cli: Cli, root: Path) -> None:
    own = Path("own.yaml")
    shutil.move(root / "fault_library" / "faults" / "sensor" / "distance.yaml", own)
    assert cli("diff", own).code == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["sensor/distanc"], "sensor/distance"),
        (["missing.yaml"], "missing.yaml"),
        (["sensor/distance", "--variant", "shorter"], "longer, nearer"),
        (["sensor/silence", "--value", "3"], "takes no value"),
        (["sensor/distance", "--trigger", "hwt <"], "near, far"),
        (["sensor/distance", "--trigger", "__import__('os')"], "--trigger"),
        (["sensor/distance", "--reading", "as_guessed"], "as_described"),
        (["sensor/distance", "--manifest", "plane"], "plane"),
        (["abcd"], "runs/"),
    ],
)
def test_an_unknown_choice_lists_the_known_ones(cli: Cli, root: Path, words: list[str], said: str) -> None:
    answer = cli("diff", *words)
    assert answer.code == 2
    assert said in answer.err
    assert "Traceback" not in answer.err


def read_index(out: Path) -> list[dict[str, str]]:
    with (out / "index.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_generate_writes_patches_that_apply(cli: Cli, root: Path) -> None:
    out = Path("mutants")
    assert cli("generate", "sensor/*", "--out", out).code == 0
    index = read_index(out)
    assert len(index) == 11 * 2  # faults x contexts
    pristine = (root / "tree" / "toycar" / "sensing.py").read_bytes()
    for line in index:
        tree = Path("tree")
        shutil.copytree(root / "tree", tree)
        patch = (out / line["patch"]).read_bytes()
        subprocess.run(["patch", "-p1", "-s"], input=patch, cwd=tree, check=True)
        changed = (tree / "toycar" / "sensing.py").read_bytes()
        assert changed != pristine
        assert unsplice(changed) == pristine
        shutil.rmtree(tree)


def test_a_generated_tree_equals_the_patched_target(cli: Cli, root: Path) -> None:
    out = Path("mutants")
    cli("generate", "sensor/distance", "--out", out, "--trees", "--trigger", "near", "--trigger", "3")
    for line in read_index(out):
        shutil.copytree(root / "tree", "tree")
        subprocess.run(
            ["patch", "-p1", "-s"], input=(out / line["patch"]).read_bytes(), cwd="tree", check=True
        )
        same = subprocess.run(["diff", "-r", "tree", out / line["tree"]], check=False)
        assert same.returncode == 0
        shutil.rmtree("tree")


def test_generate_samples_mutants_of_operators(cli: Cli, root: Path) -> None:
    words = ("--operators", "arithmetic,branch", "--in", "toycar/*.py::Driver.drive", "--scenario", "A")
    answer = cli("generate", *words, "--sample", 5, "--seed", 3, "--out", "m")
    assert answer.code == 0 and "5 draws of " in answer.err
    index = read_index(Path("m"))
    assert len(index) == 5
    assert {line["spec"] for line in index} == {
        f"operators/{name}/toycar/driver.py::Driver.drive" for name in ("arithmetic", "branch")
    }
    assert all(" -> " in line["value"] for line in index)


def test_the_index_describes_each_mutant(cli: Cli, root: Path) -> None:
    [near] = cli("generate", "sensor/distance", "--out", "m", "--trigger", "near", "--json").json[:1]
    assert near["spec"] == "sensor/distance/longer"
    assert near["condition"] == "hwt <= 2.0"
    assert near["unit"] == "m"
    assert near["files"] == "toycar/_fi.py;toycar/go.py;toycar/sensing.py"


def test_ids_are_stable(cli: Cli, root: Path) -> None:
    for out in ("a", "b"):
        cli("generate", "sensor/distance", "--out", out)
    assert subprocess.run(["diff", "-r", "a", "b"], check=False).returncode == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "no spec given"),
        (["nothing*"], "no spec matches"),
        (["sensor/distance", "--campaign", "x"], "one or the other"),
        (["--in", "toycar/driver.py"], "without --operators"),
        (["--operators", "branch", "--in", "toycar/driver.py"], "either --scenario or --all-lines"),
        (["--operators", "branch", "--in", "toycar/none.py", "--all-lines"], "no Python file"),
        (["--operators", "branches", "--in", "toycar/driver.py", "--all-lines"], "did you mean 'branch'"),
    ],
)
def test_generate_refuses_an_invalid_selection_of_mutants(
    cli: Cli, root: Path, words: list[str], said: str
) -> None:
    answer = cli("generate", *words, "--out", "m")
    assert answer.code == 2
    assert said in answer.err


def test_generate_refuses_a_folder_with_content(cli: Cli, root: Path) -> None:
    Path("m").mkdir()
    (Path("m") / "mine.txt").write_text("keep")
    answer = cli("generate", "sensor/distance", "--out", "m")
    assert answer.code == 2
    assert [p.name for p in Path("m").iterdir()] == ["mine.txt"]
