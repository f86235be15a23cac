"""The action for GitHub: its steps run as a runner runs them, on pull requests of a scripted repository."""

import re
import shutil
from pathlib import Path

import pytest
import yaml

from mutator.comparison.gate_failures import RECOMMENDED_GATES
from tests.github_runner import ACTION, CLONE, STEPS, Runner, build_runner, git

PAGE = CLONE / "docs" / "how-to" / "show-hazards-in-a-pull-request.md"


def test_the_default_gate_is_the_recommended_one() -> None:
    kinds = ACTION["inputs"]["fail-on"]["default"].split(",")
    assert kinds == [gate.value for gate in RECOMMENDED_GATES]


def test_no_script_contains_an_expression() -> None:
    """A branch's name in a script would be run as a command."""
    for step in STEPS:
        assert "${{" not in step.get("run", "")
        assert ("run" in step) == (step.get("shell") == "bash")
        assert "run" in step or re.fullmatch(r"[\w/-]+@v\d+", step["uses"])


def test_expressions_name_inputs_and_outputs_that_exist() -> None:
    outputs = {
        step["id"]: set(re.findall(r'echo "([\w-]+)=', step.get("run", ""))) for step in STEPS if "id" in step
    }
    of_actions = {"python": {"python-version"}, "environment": {"cache-hit"}, "base-run": {"cache-hit"}}
    text = yaml.safe_dump(ACTION, width=10_000)
    named = re.findall(r"steps\.([\w-]+)\.outputs\.([\w-]+)", text)
    assert named
    for step, output in named:
        assert output in outputs[step] | of_actions.get(step, set())
    assert set(re.findall(r"inputs\.([\w-]+)", text)) == set(ACTION["inputs"])


def test_the_page_explains_every_input() -> None:
    rows = re.findall(r"^\| `([\w-]+)` \|", PAGE.read_text(), re.MULTILINE)
    assert [name for name in rows if name in ACTION["inputs"]] == list(ACTION["inputs"])


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A repository with the toy car, its library and the templates, and what a runner checks out of it."""
    origin, toy = tmp_path / "origin", CLONE / "tests" / "toy"
    ignored = shutil.ignore_patterns("__pycache__", "hostile")
    shutil.copytree(toy / "fault_library", origin / "fault_library", ignore=ignored)
    shutil.copytree(toy / "tree", origin / "tree", ignore=ignored)
    shutil.copytree(CLONE / "templates", origin / "templates", ignore=ignored)
    git(origin, "init", "--quiet")
    git(origin, "add", ".")
    git(origin, "commit", "--quiet", "-m", "toy car")
    git(tmp_path, "clone", "--quiet", "--depth=1", origin.as_uri(), "work")
    return tmp_path / "work"


@pytest.fixture
def runner(repository: Path, tmp_path: Path) -> Runner:
    return build_runner(repository, tmp_path)


def change(repository: Path, path: str, old: str, new: str) -> None:
    file = repository / path
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    git(repository, "commit", "--quiet", "--all", "-m", "change")


def test_a_run_with_harness_errors_shows_the_end_of_its_output(runner: Runner) -> None:
    """Such a run has no line that begins with `error`."""
    mutator = runner.temp / "bin" / "mutator"
    mutator.write_text("#!/bin/sh\nseq 30\necho '100% harness errors: 2'\nexit 3\n")
    mutator.chmod(0o755)
    runner.context |= {"inputs.campaign": "small", "steps.keys.outputs.runs": str(runner.temp / "runs")}
    (runner.temp / "runs").mkdir()
    [step] = [step for step in STEPS if step.get("name") == "Run the campaign on this version"]
    assert runner.run_step(step) == 3
    [error] = runner.annotations("error")
    assert error.startswith("::error title=The campaign did not finish::12%0A13%0A")
    assert error.endswith("%0A30%0A100%25 harness errors: 2")
    summary = (runner.temp / "summary.md").read_text()
    assert summary.endswith("    30\n    100% harness errors: 2\n\n")


@pytest.mark.slow
def test_a_change_with_new_hazards_fails_with_annotations_summary_and_sarif(
    runner: Runner, repository: Path
) -> None:
    change(repository, "tree/toycar/driver.py", "-0.6 * offset", "-0.6 * (offset + 0.3)")
    (repository / "packages.txt").write_text("numpy\n")
    assert runner.run({"campaign": "toy", "workers": "0", "requirements": "packages.txt"}) == 1, runner.log
    errors = runner.annotations("error")
    assert errors
    assert all(line.startswith("::error file=tree/toycar/sensing.py,line=") for line in errors)
    summary = (runner.temp / "summary.md").read_text()
    assert summary.startswith("## base against new\n\n**The gate fails for ")
    assert "Files of the target changed: toycar/driver.py." in summary
    assert re.search(r"`--since`: \d+ of \d+ left out", summary)
    assert "```mermaid" in summary
    runs = runner.temp / "mutator-runs" / "toy"
    assert runner.context["steps.files.outputs.sarif"] == str(runs / "hazards.sarif")
    assert '"uri": "tree/toycar/sensing.py"' in (runs / "hazards.sarif").read_text()
    assert (runs / "new" / "exports" / "new-report.html").is_file()
    assert (runs / "comparison" / "index.html").is_file()
    assert 'file="tree/toycar/' in (runs / "junit.xml").read_text()
    installed = (runner.temp / "mutator-environment" / "bin" / "pip.log").read_text()
    assert f"--constraint {CLONE}/constraints.txt {CLONE}\n" in installed
    assert "--requirement packages.txt" in installed
    assert runner.skipped == ["Say that SARIF is left out"]
    assert any((runner.temp / "mutator-store").iterdir())
    assert re.search(r"since base: \d+ of \d+ left out", runner.log)


@pytest.mark.slow
def test_a_refactoring_from_a_fork_passes_and_says_that_sarif_is_left_out(
    runner: Runner, repository: Path
) -> None:
    """The second job, which has the store of the first, runs no experiment again."""
    change(
        repository,
        "tree/toycar/driver.py",
        "gap, closing, offset = reading",
        "(gap, closing, offset) = reading",
    )
    runner.context["github.event.pull_request.head.repo.fork"] = "true"
    inputs = {"campaign": "fault_library/campaigns/small.yaml", "workers": "0", "base": "main"}
    assert runner.run(inputs) == 0, runner.log
    assert runner.annotations("error") == []
    assert runner.annotations("notice") == [
        "::notice::SARIF is not uploaded to code scanning, because the token of a fork can only read. "
        "It is in the artifact."
    ]
    summary = (runner.temp / "summary.md").read_text()
    assert "**The gate passes: no experiment fails `new-hazard`" in summary
    assert "SARIF is not uploaded" in summary
    shutil.rmtree(runner.temp / "mutator-runs")
    runner.log = ""
    assert runner.run(inputs) == 0, runner.log
    assert len(re.findall(r"^(\d+) of \1 reused", runner.log, re.MULTILINE)) == 2


@pytest.mark.slow
def test_a_campaign_that_cannot_start_is_an_error_in_the_summary(runner: Runner, repository: Path) -> None:
    """With this change, the car leaves its lane without any fault, also where the canary is."""
    change(repository, "tree/toycar/driver.py", "-0.6 * offset", "0.6 * (offset + 1)")
    assert runner.run({"campaign": "small", "workers": "0"}) == 2, runner.log
    [error] = runner.annotations("error")
    assert "::error: " in error
    assert "the canary's golden run" in error
    assert "without any fault" in error
    summary = (runner.temp / "summary.md").read_text()
    assert summary.startswith("## small did not finish on this version\n\n    error: ")
    assert runner.skipped[:1] == ["Compare"]


def test_a_campaign_that_does_not_exist_is_an_error_in_the_summary(runner: Runner) -> None:
    assert runner.run({"campaign": "nowhere", "workers": "0", "base": "main"}) == 2
    [error] = runner.annotations("error")
    assert error.startswith("::error title=The campaign cannot start::error: ")
    assert "'nowhere'" in error
    assert (runner.temp / "summary.md").read_text().startswith("## nowhere cannot start\n\n    error: ")


@pytest.mark.slow
def test_a_base_that_does_not_exist_is_an_error(runner: Runner) -> None:
    assert runner.run({"campaign": "small", "workers": "0", "base": "nowhere"}) == 2
    assert runner.annotations("error") == [
        "::error::cannot fetch 'nowhere' to compare with: correct the input 'base'"
    ]


def test_a_base_is_no_option_of_git(runner: Runner, tmp_path: Path) -> None:
    """A workflow can take it from a form, or from a comment."""
    step = next(step for step in STEPS if step.get("id") == "base")
    runner.context["inputs.base"] = f"--upload-pack=touch {tmp_path}/ran; git-upload-pack"
    assert runner.run_step(step) == 2
    assert not (tmp_path / "ran").exists()
    [error] = runner.annotations("error")
    assert error.startswith("::error::cannot fetch '--upload-pack=")
