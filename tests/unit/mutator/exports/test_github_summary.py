"""Summaries on GitHub."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mutator.campaigns.fault_positions import SourcePosition
from mutator.comparison.gate_failures import RECOMMENDED_GATES, failing_experiments, worst_first
from mutator.comparison.run_comparison_and_gates import Comparison, Gate, compare_runs, findings_of_gates
from mutator.exports.github_summary import Repository, comparison_summary
from mutator.exports.highlights import ChartMaker, HighlightedSource, highlights_of_failures
from mutator.model import Experiment, Outcome
from mutator.outcomes.series_sampling import write_sampled_series
from mutator.store.checksummed_lines import LineWriter
from mutator.store.run_folder import RunFolder
from mutator.store.timings import TIMINGS_FOLDER, TIMINGS_SCHEMA
from mutator.workspace import Workspace

NO_LINKS = Repository()
CHANNELS = ("gas", "brake", "wheel_turn", "gap", "speed")


def became(e: Experiment) -> dict[str, Any]:
    if e.fault.fault_type == "distance":
        return {}
    return {
        "outcome": Outcome.HAZARD,
        "hazards": (("H3", 4.0),),
        "first_change": ("gas", "higher"),
    }


@pytest.fixture(scope="module")
def compared(workspace: Workspace, write_run: Callable[..., Path]) -> Comparison:
    """A run in which lane and silence become hazards. All series are kept."""
    folder = workspace.library.parent
    runs = write_run(workspace, folder / "before"), write_run(workspace, folder / "after", became)
    t = np.arange(0.0, 6.0, 0.05)
    trace = {"time": t, **{name: np.sin(t) for name in CHANNELS}}
    for run in runs:
        for record in RunFolder.open(run).records().values():
            write_sampled_series(run, workspace.manifest("toycar"), trace, trace, record)
    return compare_runs(*runs)


def summary(
    compared: Comparison,
    workspace: Workspace | None,
    gates: Sequence[Gate] = RECOMMENDED_GATES,
    repository: Repository = NO_LINKS,
) -> str:
    source = HighlightedSource.of_run(compared.b.folder, workspace)
    failing = failing_experiments(compared, findings_of_gates(compared, gates))
    highlights = highlights_of_failures(source, worst_first(compared, failing))
    charts = ChartMaker(folder=compared.b.folder, source=source, comparison=compared)
    return comparison_summary(compared, gates, highlights, charts, repository)


def test_the_verdict_comes_first_and_then_three_with_sentence_place_and_chart(
    compared: Comparison, workspace: Workspace
) -> None:
    lines = summary(compared, workspace).splitlines()
    hazards = sum(bool(pair.row_b.hazards) for pair in compared.pairs)
    assert lines[0] == "## before against after"
    assert lines[2] == (
        f"**The gate fails for {hazards} experiments: "
        f"`new-hazard` {hazards}, `new-silent-hazard` {hazards}.**"
    )
    assert lines[4] == f"Worse: {hazards} of 24 experiments in both runs got worse."
    text = "\n".join(lines)
    worst, others = text.split("### The worst")[1].split("### And")
    assert worst.count("#### sensor/") == worst.count("```mermaid") == worst.count("Hazard H3 occurs") == 3
    assert worst.count("`tree/toycar/sensing.py:") == 3
    assert "green" not in worst and worst.count("`gas` over time. Grey: without the fault, blue: with") == 3
    table, _, numbers = others.partition("### What changed")
    assert table.count("| `tree/toycar/sensing.py:") == hazards - 3
    assert "| sensor/lane |" in numbers


def test_the_summary_says_what_a_change_could_not_affect(
    toycar: Workspace, tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    """It counts what `--since` left out, and says why the others ran."""
    runs = write_run(toycar, tmp_path / "before"), write_run(toycar, tmp_path / "after")
    names = list(RunFolder.open(runs[1]).records())
    timings = LineWriter(runs[1] / TIMINGS_FOLDER / "0001-a.jsonl", {"schema": TIMINGS_SCHEMA})
    times = {"cpu_s": 0.0, "wall_s": 0.0, "ended": "2026-01-01T00:00:00Z", "why": ""}
    for name in names:
        line = {"experiment_id": name, "worker": "0001-a", "host": "here", "engine": "unaffected"}
        ran = {"engine": "fork", "affected": "a_b.py is new"} if name == names[0] else {}
        timings.append({**line, **times, **ran})
    timings.close()
    count = f"{len(names) - 1} of {len(names)} left out, because nothing that they executed has changed"
    text = f"`--since`: {count}; the others ran: a_b.py is new (1)."
    assert text in summary(compare_runs(*runs), toycar).splitlines()
    assert "--since" not in summary(compare_runs(*reversed(runs)), toycar)


def test_a_gate_that_passes_says_for_what_it_looked(compared: Comparison, workspace: Workspace) -> None:
    text = summary(compared, workspace, [Gate.LOST_ALERT, Gate.UNMATCHED])
    assert "**The gate passes: no experiment fails `lost-alert`, `unmatched`.**" in text
    assert "### The worst" not in text


def test_missing_results_leave_the_gate_undecided(
    toycar: Workspace, tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    part = write_run(toycar, tmp_path / "part", lambda e: None if e.scenario == "A" else {})
    text = summary(compare_runs(write_run(toycar, tmp_path / "whole"), part), toycar)
    missing = sum(e.scenario == "A" for e in compare_runs(part, part).b.experiments)
    assert f"**The gate cannot decide: {missing} results missing.** It looks for `new-hazard`" in text


def test_without_the_target_places_are_missing_for_a_reason(
    compared: Comparison, workspace: Workspace, toycar: Workspace
) -> None:
    for other, reason in ((None, "the fault library was not found"), (toycar, "has changed since this run")):
        driver = toycar.library.parent / "tree" / "toycar" / "driver.py"
        driver.write_text("x = 1\n")
        text = summary(compared, other)
        assert "Places in the source are not shown: " in text
        assert reason in text
        assert "sensing.py" not in text
        assert text.count("```mermaid") == 3


def test_places_link_to_the_lines_of_the_commit(compared: Comparison, workspace: Workspace) -> None:
    environment = {
        "GITHUB_SERVER_URL": "https://git.example",
        "GITHUB_REPOSITORY": "me/car",
        "GITHUB_SHA": "c0ffee",
    }
    text = summary(compared, workspace, repository=Repository.from_environment(environment))
    assert "(https://git.example/me/car/blob/c0ffee/tree/toycar/sensing.py#L" in text
    position = SourcePosition(path="a b.py", first_line=3, last_line=4)
    linked = Repository.from_environment(environment).link(position)
    assert linked == "[`a b.py:3`](https://git.example/me/car/blob/c0ffee/a%20b.py#L3-L4)"
    assert Repository.from_environment({}).link(position) == "`a b.py:3`"
