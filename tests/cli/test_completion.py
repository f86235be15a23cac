"""The completions that a shell offers for Tab."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json
Complete = Callable[..., list[str]]


@pytest.fixture
def complete(cli: Cli, root: Path, monkeypatch: pytest.MonkeyPatch) -> Complete:
    """Return the completions after these words, the last of which the user is still typing."""

    def ask(*words: str) -> list[str]:
        monkeypatch.setenv("_MUTATOR_COMPLETE", "complete_bash")
        monkeypatch.setenv("COMP_WORDS", " ".join(("mutator", *words)))
        monkeypatch.setenv("COMP_CWORD", str(len(words)))
        answer = cli()
        monkeypatch.delenv("_MUTATOR_COMPLETE")
        assert (answer.code, answer.err) == (0, "")
        return answer.out.split()

    return ask


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (["pl"], ["places", "plan"]),
        (["run", "sm"], ["small"]),
        (["plan", "toy"], ["toy"]),
        (["try", "sensor/dis"], ["sensor/distance"]),
        (["generate", "sensor/si"], ["sensor/silence"]),
        (["try", "sensor/lane", "--scenario", "A"], ["A"]),
        (["check", "--manifest", "t"], ["toycar"]),
        (["run", "nothing_like_it"], []),
        (["export", "runs/x", "--format", "mut"], ["mutation-elements"]),
        (["try", "sensor/lane", "--trigger", ""], ["always", "far", "near"]),
        (["run", "small", "--engine", "f"], ["fork"]),
        (["compare", "a", "b", "--fail-on", "new-hazard,new-c"], ["new-hazard,new-crash"]),
        (["plan", "small", "--only", "fault_t"], ["fault_type"]),
        (["plan", "small", "--only", "value>1and_not_in(scen"], ["value>1and_not_in(scenario"]),
        (["review", "list", "--only", "stat"], ["state"]),
    ],
)
def test_names_are_completed_from_their_first_letters(
    complete: Complete, words: list[str], offered: list[str]
) -> None:
    assert complete(*words) == offered


def test_run_folders_and_their_experiments_are_completed(complete: Complete, cli: Cli) -> None:
    cli("plan", "small", "--out", "runs/old", "--limit", "2")
    cli("plan", "toy", "--out", "runs/new", "--limit", "2")
    os.utime("runs/old/run.json", (1, 1))
    old, new = (
        sorted(line.split(",")[0] for line in Path(f"runs/{name}/plan.csv").read_text().splitlines()[1:])
        for name in ("old", "new")
    )
    assert complete("report", "runs/") == ["runs/new", "runs/old"]
    assert complete("show", "--run", "runs/o") == ["runs/old"]
    assert complete("show", "") == new
    assert complete("show", new[0][:6]) == new[:1]
    assert complete("rerun", "--run", "runs/old", "") == old
    Path("runs/new/results.csv").write_text("experiment_id,delta_v,detail\n")
    assert complete("show", "--only", "de") == ["delta_v", "detail"]
    assert complete("export", "runs/new", "--format", "mcap", "--only", "de") == ["delta_v", "detail"]
    Path("runs/old/plan.csv").write_bytes(b"\xff")
    assert complete("rerun", "--run", "runs/old", "") == []


def test_library_options_apply_to_completion(
    complete: Complete, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MUTATOR_ROOT")
    assert "small" not in complete("run", "")
    assert "small" in complete("--root", str(root), "run", "")
    assert "small" in complete("run", "--library", str(root / "fault_library"), "")


def test_the_script_for_a_shell_is_printed(cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("typer.completion._get_shell_name", lambda: "bash")
    answer = cli("--show-completion")
    assert answer.code == 0
    assert "_MUTATOR_COMPLETE=complete_bash" in answer.out
    assert answer.out.rstrip().endswith("-F _mutator_completion mutator")


def test_completion_imports_few_modules(root: Path) -> None:
    code = (
        "import sys\nfrom mutator.cli.app import main\nassert main() == 0\n"
        "print(sorted({'jinja2', 'libcst', 'numpy', 'pandas', 'yaml', 'rich'} & set(sys.modules)))"
    )
    asked = {"_MUTATOR_COMPLETE": "complete_bash", "COMP_WORDS": "mutator run sm", "COMP_CWORD": "2"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=os.environ | asked
    )
    assert done.stdout.splitlines() == ["small", "[]"]
