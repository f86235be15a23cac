"""The outcomes of a group's mutants in a run."""

import shutil
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import sleep
from typing import Any

import pytest

from mutator.campaigns.plan import build_plan
from mutator.errors import MutatorError
from mutator.model import Outcome, Status
from mutator.results import table_building
from mutator.results.result_rows import ResultRow
from mutator.results.table_reader import Results
from mutator.review.group_results import describe_result, results_of_group
from mutator.review.mutant_groups import groups_of_plan
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

WriteRun = Callable[..., Path]
HAZARD = {"outcome": Outcome.HAZARD, "t_manifest": 2.5}


def test_a_group_has_counts_a_typical_and_a_worst_experiment(
    toycar: Workspace, tmp_path: Path, write_run: WriteRun
) -> None:
    """The typical experiment is the median of the most frequent ending."""
    plan = build_plan(toycar, "toy", Choices())
    lane = [e.id for e in plan.experiments if e.fault.fault_type == "lane"]
    bad = {name: {"hazards": (("H3", 3.0 + i),), **HAZARD} for i, name in enumerate(lane[:2])}
    run = write_run(toycar, tmp_path / "run", lambda e: bad.get(e.id, {}))
    table_building.ensure_tables(run)
    group = next(g for g in groups_of_plan(toycar, plan) if "offset: offset" in g.label)
    found = results_of_group(RunFolder.open(run), group)
    assert found is not None
    assert found.experiments == len(lane) > 4
    assert found.outcomes == {"masked": len(lane) - 2, "hazard": 2}
    assert found.typical.ending == "masked"
    assert found.typical.id in set(lane) - bad.keys()
    assert found.worst.id in bad
    assert found.worst.label.startswith("sensor/lane/shifted ")
    assert found.worst.verdict.endswith("after activation; no alert")


def test_a_group_without_experiments_has_no_verdict(
    toycar: Workspace, tmp_path: Path, write_run: WriteRun
) -> None:
    """The group of the probe has no experiments, because all mutants share the probe."""
    run = RunFolder.open(write_run(toycar, tmp_path / "run", only='fault_type == "silence"'))
    table_building.ensure_tables(run.path)
    groups = groups_of_plan(toycar, build_plan(toycar, "toy", Choices()))
    told = {group.models for group in groups if results_of_group(run, group)}
    assert told == {("omission",)}


def test_later_results_are_counted(toycar: Workspace, tmp_path: Path, write_run: WriteRun) -> None:
    group = next(g for g in groups_of_plan(toycar, build_plan(toycar, "toy", Choices())) if g.faults)
    write_run(toycar, tmp_path / "run", lambda e: None)
    with pytest.raises(MutatorError, match="no results here"):
        results_of_group(RunFolder.open(tmp_path / "run"), group)
    table_building.ensure_tables(tmp_path / "run")
    assert results_of_group(RunFolder.open(tmp_path / "run"), group) is None
    shutil.rmtree(tmp_path / "run")
    table_building.ensure_tables(write_run(toycar, tmp_path / "run"))
    assert results_of_group(RunFolder.open(tmp_path / "run"), group)


def test_the_results_are_read_once_for_many_groups(
    toycar: Workspace, tmp_path: Path, write_run: WriteRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Reading a large table takes seconds and much memory."""
    run = RunFolder.open(write_run(toycar, tmp_path / "run"))
    table_building.ensure_tables(run.path)
    groups = groups_of_plan(toycar, build_plan(toycar, "toy", Choices()))
    read: list[Results] = []
    frame = Results.frame

    def slowly(table: Results) -> Any:
        read.append(table)
        sleep(0.05)
        return frame(table)

    monkeypatch.setattr(Results, "frame", slowly)
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda group: results_of_group(run, group), groups))
    assert len(read) == 1 < len([one for one in found if one])


def row(**given: Any) -> ResultRow:
    fields: dict[str, Any] = {
        "experiment_id": "e", "kind": "m/f", "variant": "v", "value": "", "unit": "",
        "scenario": "A", "scenario_label": "A", "trigger": "C1", "status": Status.OK, "outcome": None,
        "t_activation": 2.0, "t_manifest": 2.5, "hazards": (), "alerts": (), "t_alert": None,
        "reaction_time": None, "detail": "",
    }  # fmt: skip
    fields |= given
    return ResultRow(ending=(fields["outcome"] or fields["status"]).value, **fields)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            {"outcome": Outcome.SDC},
            "sdc: an actuator first differed from the golden run at 2.50 s; no hazard",
        ),
        (
            {"outcome": Outcome.HAZARD, "hazards": (("H1", 4.25),), "alerts": ("fcw",), "t_alert": 3.0},
            "hazard H1 (a crash) at 4.25 s, 2.25 s after activation; alert fcw at 3.00 s",
        ),
        (
            {"outcome": Outcome.HAZARD, "hazards": (("H9", 4.0),), "t_activation": None},
            "hazard H9 at 4.00 s; no alert",
        ),
        ({"status": Status.CRASHED, "detail": "ValueError: no"}, "crashed: ValueError: no"),
        ({"outcome": Outcome.MASKED}, "masked: no actuator differed from the golden run"),
    ],
)
def test_a_verdict_is_put_into_words(given: dict[str, Any], words: str) -> None:
    assert describe_result(row(**given), {"H1": "a crash"}) == words
