"""`compare` and `export` on the command line."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator.comparison.gate_failures import RECOMMENDED_GATES
from mutator.model import Experiment, Outcome, Status
from mutator.workspace import Workspace

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json
Write = Callable[..., Path]


def worse(e: Experiment) -> dict[str, Any]:
    hazard = {"outcome": Outcome.HAZARD, "hazards": (("H1", 3.0),)}
    return hazard if e.fault.fault_type == "silence" and e.scenario == "A" else {}


@pytest.fixture
def runs(root: Path, write_run: Write) -> tuple[Path, Path]:
    workspace = Workspace.find(root)
    return write_run(workspace, Path("before")), write_run(workspace, Path("after"), worse)


def test_compare_prints_and_writes_the_changes(cli: Cli, runs: tuple[Path, Path]) -> None:
    answer = cli("compare", *runs)
    assert answer.code == 0, answer.err
    for wanted in ("new-hazard", "sensor/silence", "In both runs: 24 experiments"):
        assert wanted in answer.out
    for name in ("COMPARISON.md", "index.html", "pairs.csv", "unmatched.csv"):
        assert (Path("after") / "report" / "compare-before" / name).is_file()


def test_a_different_selection_is_reported_before_any_table(cli: Cli, root: Path, write_run: Write) -> None:
    workspace = Workspace.find(root)
    runs = write_run(workspace, Path("whole")), write_run(workspace, Path("part"), limit=6)
    said = "The runs are different parts of a campaign: whole has everything, part has --limit 6."
    answer = cli("compare", *runs, "--out", "c")
    assert answer.code == 0, answer.err
    assert answer.out.startswith(said)
    assert answer.out.count("different parts") == 1
    written = (Path("c") / "COMPARISON.md").read_text()
    assert written.index(said) < written.index("What differs")
    assert cli("compare", *runs, "--json", "--out", "c").json["remarks"][0].startswith(said)
    assert "different parts" not in cli("compare", runs[1], runs[1], "--out", "d").out


def test_different_campaigns_are_reported_before_any_table(cli: Cli, root: Path, write_run: Write) -> None:
    """So is a campaign file that changed between the runs; only experiments of both are compared."""
    workspace = Workspace.find(root)
    runs = [write_run(workspace, Path(name), campaign=name) for name in ("toy", "small")]
    answer = cli("compare", *runs, "--out", "c")
    assert answer.code == 0, answer.err
    assert answer.out.startswith("The runs are of different campaigns: toy and small.")
    assert (Path("c") / "COMPARISON.md").read_text().count("different campaigns: toy and small") == 1
    assert cli("compare", *runs, "--out", "c", "--fail-on", "unmatched").code == 1
    file = root / "fault_library" / "campaigns" / "toy.yaml"
    file.write_text(file.read_text() + "# changed\n")
    changed = write_run(workspace, Path("changed"))
    answer = cli("compare", runs[0], changed, "--out", "c")
    assert answer.out.startswith("The file of the campaign toy differs between the runs.")
    refused = cli("compare", *runs, "--only", 'method == "random" and value == 1.0')
    assert (refused.code, "(campaign toy and small; experiments" in refused.err) == (2, True)


def test_alerts_of_fault_free_runs_are_named(
    cli: Cli, runs: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    note = "Not every alert is caused by a fault: fault-free runs raise fcw in A."
    monkeypatch.setattr(mutator.Run, "alerts_note", lambda run: note if run.path.name == "after" else "")
    answer = cli("compare", *runs, "--out", "c")
    assert f"after: {note}" in " ".join(answer.out.split())
    assert "before: Not every" not in answer.out
    assert f"after: {note}" in (Path("c") / "COMPARISON.md").read_text()
    assert "after: Not every alert" in (Path("c") / "index.html").read_text()
    before, after = map(mutator.load_run, runs)
    assert "after: Not every alert" in mutator.compare(before, after)._repr_html_()
    assert "Not every alert" in after._repr_html_()
    assert "Not every alert" not in before._repr_html_()


def test_a_gate_fails_for_a_new_hazard(cli: Cli, runs: tuple[Path, Path]) -> None:
    failed = cli("compare", *runs, "--out", "c", "--fail-on", "new-hazard,unmatched")
    assert failed.code == 1
    assert "new-hazard: sensor/silence/no_data, A, guided" in failed.err
    assert (Path("c") / "index.html").is_file()
    both = cli("compare", *runs, "--out", "c", "--fail-on", "new-hazard,new-silent-hazard")
    assert both.err.count("sensor/silence/no_data, A, guided far") == 1
    assert "new-hazard, new-silent-hazard: sensor/silence/no_data, A, guided" in both.err
    assert cli("compare", *reversed(runs), "--fail-on", "lost-alert", "--fail-on", "new-hazard").code == 0


def test_the_recommended_gate_fails_for_a_hazard_beside_another(
    cli: Cli, root: Path, write_run: Write
) -> None:
    """A fault that led to H3 and now also to H1 has a new hazard, although an alert comes before it."""
    docs = Path(__file__).parents[2] / "docs"
    pages = ("how-to/gate-a-change-in-ci.md", "tutorial/tour-controller-developer.md", "reference/cli.md")
    pattern = re.compile(r"--fail-on (new-hazard,\S+)")
    [gate] = {kinds for page in pages for kinds in pattern.findall((docs / page).read_text())}
    assert gate.split(",") == [each.value for each in RECOMMENDED_GATES]

    def run(name: str, *hazards: tuple[str, float]) -> Path:
        fields = {"outcome": Outcome.HAZARD, "hazards": hazards, "alerts": (("fcw", 2.5),)}
        return write_run(Workspace.find(root), Path(name), lambda e: fields, campaign="small")

    one, two = run("one", ("H3", 3.0)), run("two", ("H3", 3.0), ("H1", 4.0))
    refused = cli("compare", one, two, "--fail-on", gate)
    assert refused.code == 1
    assert "error: other-hazard: " in refused.err
    assert cli("compare", two, one, "--fail-on", gate).code == 0


def test_a_run_equals_itself(cli: Cli, runs: tuple[Path, Path]) -> None:
    _, after = runs
    answer = cli("compare", after, after, "--json", "--fail-on", "new-hazard,worse,harness-error,unmatched")
    assert answer.code == 0
    assert (answer.json["pairs"], answer.json["changed"], answer.json["differs"]) == (24, 0, [])


def test_a_gate_fails_if_results_are_missing(cli: Cli, root: Path, write_run: Write) -> None:
    """A regression cannot be ruled out, so the exit code is 3."""
    workspace = Workspace.find(root)
    whole = write_run(workspace, Path("whole"), campaign="small")
    part = write_run(
        workspace, Path("part"), lambda e: None if e.method == "random" else {}, campaign="small"
    )
    answer = cli("compare", whole, part, "--fail-on", "new-hazard")
    assert answer.code == 3
    assert "results missing" in answer.err
    broken = {"status": Status.HARNESS_ERROR, "outcome": None, "activation": None}
    bad = write_run(
        workspace, Path("bad"), lambda e: broken if e.method == "random" else {}, campaign="small"
    )
    assert cli("compare", whole, bad, "--fail-on", "harness-error").code == 1


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--fail-on", "hazards"], "'hazards'"),
        (["--only", "nonsense > 1"], "unknown column `nonsense`"),
    ],
)
def test_an_unknown_kind_or_filter_is_refused(
    cli: Cli, runs: tuple[Path, Path], words: list[str], told: str
) -> None:
    answer = cli("compare", *runs, *words)
    assert answer.code == 2
    assert told in answer.err
    assert "expected" in answer.err


def test_each_format_is_exported(cli: Cli, runs: tuple[Path, Path]) -> None:
    _, after = runs
    answer = cli("export", after, "--format", "mutation-elements", "--out", "m.json")
    assert answer.code == 0, answer.err
    assert json.loads(Path("m.json").read_text())["schemaVersion"] == "2.0"
    for name in ("junit", "csv", "parquet"):
        made = cli("export", after, "--format", name, "--json")
        assert made.code == 0, made.err
        assert Path(made.json["file"]).stat().st_size > 0
    failures = cli("export", after, "--format", "junit", "--failures", "hazard", "--out", "j.xml")
    assert failures.code == 0
    assert '<failure type="hazard"' in Path("j.xml").read_text()
    assert cli("export", after, "--format", "junit", "--failures", "harness_error").code == 2
    assert cli("export", after, "--format", "pdf").code == 2
    for folder in (".", "after"):
        refused = cli("export", after, "--format", "csv", "--out", folder)
        assert (refused.code, "expected: a file to write" in refused.err) == (2, True)


def test_a_gate_on_severity_needs_classes(cli: Cli, runs: tuple[Path, Path]) -> None:
    answer = cli("compare", *runs, "--fail-on", "severity:S2")
    assert answer.code == 2
    assert "has no severity classes" in answer.err
    assert "severity:S2" in cli("compare", *runs, "--fail-on", "severity:S9").err
