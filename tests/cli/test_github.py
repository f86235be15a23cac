"""`--github`: annotations and summaries."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.model import Experiment, Outcome
from mutator.workspace import Workspace

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json


def became(e: Experiment) -> dict[str, Any]:
    hazard = {"outcome": Outcome.HAZARD, "hazards": (("H1", 3.0),)}
    return hazard if e.fault.fault_type == "silence" else {}


@pytest.fixture
def summary(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The file for summaries, in which another command has written."""
    path = tmp_path / "summary.md"
    path.write_text("before\n")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(path))
    return path


@pytest.fixture
def runs(root: Path, write_run: Callable[..., Path]) -> tuple[Path, Path]:
    (root / ".git").mkdir()
    workspace = Workspace.find(root)
    return write_run(workspace, Path("before")), write_run(workspace, Path("after"), became)


def annotations(text: str) -> list[str]:
    return [line for line in text.splitlines() if line.startswith("::")]


def test_a_failing_gate_annotates_the_line_of_each_fault(
    cli: Cli, runs: tuple[Path, Path], root: Path, summary: Path
) -> None:
    """The exit code is that of the gate."""
    failed = cli("compare", *runs, "--out", "c", "--fail-on", "new-hazard", "--github")
    assert failed.code == 1
    found = annotations(failed.out)
    assert found
    for command in found:
        head, _, message = command.partition("::")[2].partition("::")
        properties = dict(part.split("=") for part in head.removeprefix("error ").split(","))
        lines = (root / properties["file"]).read_text().splitlines()
        assert "self.publish(" in lines[int(properties["line"]) - 1]
        assert properties["title"] == "new-hazard"
        assert message.startswith("sensor/silence/no_data, ")
    text = summary.read_text()
    assert text.startswith("before\n## before against after\n\n**The gate fails for ")

    passed = cli("compare", *runs, "--out", "c", "--fail-on", "lost-alert", "--github")
    assert (passed.code, annotations(passed.out)) == (0, [])
    assert summary.read_text().startswith(text)
    assert "**The gate passes: " in summary.read_text()


def test_without_a_gate_changes_for_the_worse_are_warnings(
    cli: Cli, runs: tuple[Path, Path], summary: Path
) -> None:
    """With `--json`, they go to standard error, so that the output stays one document."""
    answer = cli("compare", *runs, "--out", "c", "--github", "--json")
    assert answer.code == 0
    assert answer.json["pairs"] == 24
    found = annotations(answer.err)
    assert found
    assert all(command.startswith("::warning file=") for command in found)
    assert "The gate" not in summary.read_text()


def test_outside_of_github_nothing_runs(
    cli: Cli, runs: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("GITHUB_STEP_SUMMARY", raising=False)
    for words in (("compare", *runs, "--out", "c"), ("run", "small", "--out", "r")):
        answer = cli(*words, "--github")
        assert answer.code == 2
        assert "--github: GITHUB_STEP_SUMMARY is not set" in answer.err
        assert "set GITHUB_STEP_SUMMARY to a file" in answer.err
    assert not Path("c").exists() and not Path("r").exists()


def test_a_summary_that_cannot_be_written_is_an_error(
    cli: Cli, runs: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path))
    answer = cli("compare", *runs, "--out", "c", "--github")
    assert (answer.code, "cannot append to " in answer.err) == (2, True)


def test_a_target_that_has_changed_is_annotated_without_lines(
    cli: Cli, runs: tuple[Path, Path], root: Path, summary: Path
) -> None:
    """The tree of the second run can be named."""
    tree = root / "tree"
    tree.rename(root / "old")
    tree.mkdir()
    (tree / "toycar").mkdir()
    (tree / "toycar" / "go.py").write_text("x = 1\n")
    words = ("compare", *runs, "--out", "c", "--fail-on", "new-hazard", "--github")
    assert all(command.startswith("::error title=") for command in annotations(cli(*words).out))
    assert "Places in the source are not shown: " in summary.read_text()
    named = annotations(cli(*words, "--target", root / "old").out)
    assert named
    assert all(command.startswith("::error file=old/toycar/") for command in named)


def test_a_run_shows_its_hazards_as_warnings(cli: Cli, root: Path, summary: Path) -> None:
    """A hazard is data: the exit code stays 0."""
    (root / ".git").mkdir()
    ran = cli("run", "small", "--out", "run", "-n", "0", "--engine", "fork", "--github", "--json")
    assert ran.code == 0, ran.err
    found = annotations(ran.err)
    hazards = ran.json["outcomes"]["hazard"]
    assert len(found) == hazards > 0
    assert all(command.startswith("::warning file=tree/toycar/") for command in found)
    text = summary.read_text()
    assert f"## small\n\n**{hazards} of {ran.json['done']} experiments led to a hazard.**" in text
    assert text.count("```mermaid") == min(hazards, 3)
    assert "| total |" in text


def test_an_error_is_shown_at_its_line(cli: Cli, root: Path, summary: Path) -> None:
    """A campaign that cannot start must not look like a gate that has not run."""
    (root / ".git").mkdir()
    campaign = root / "fault_library" / "campaigns" / "small.yaml"
    campaign.write_text(campaign.read_text().replace("scenarios: [A]", "scenarios: [Z]"))
    answer = cli("run", "small", "--out", "run", "--github")
    assert answer.code == 2
    [command] = annotations(answer.err)
    line = campaign.read_text().splitlines().index("scenarios: [Z]") + 1
    assert command.startswith(f"::error file=fault_library/campaigns/small.yaml,line={line}::")
    assert "Z" in command
    text = summary.read_text()
    assert text.startswith("before\n## mutator could not finish\n\n")
    assert "Expected: " in text
    refused = cli("compare", "nowhere", "nowhere", "--github")
    assert (refused.code, annotations(refused.err)[0][:15]) == (2, "::error::nowher")
