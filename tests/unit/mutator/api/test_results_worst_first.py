"""The worst results of a run: filtered, sorted by severity, and limited in number."""

from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.api import results_worst_first as module
from mutator.api.results_worst_first import worst_results
from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.model import Outcome, Record
from mutator.store.checksummed_lines import line_file_bytes
from mutator.store.records import RECORDS_SCHEMA, record_as_json
from mutator.workspace import Workspace


def test_filtered_results_are_sorted_by_severity(
    toycar: Workspace, tmp_path: Path, record: Callable[..., Record], monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = build_plan(toycar, "toy")
    run = freeze_plan(plan, tmp_path / "run", toycar).path
    hazard = {"outcome": Outcome.HAZARD, "hazards": (("H3", 5.0),)}
    made = [record(e.id, **(hazard if i % 5 == 0 else {})) for i, e in enumerate(plan.experiments)]
    path = run / "records" / "0001-main.jsonl"
    path.parent.mkdir()
    path.write_bytes(
        line_file_bytes(path, {"schema": RECORDS_SCHEMA, "plan": plan.digest}, map(record_as_json, made))
    )
    monkeypatch.setattr(module, "_ROWS_PER_BATCH", 7)
    rows, count = worst_results(run)
    assert count == len(rows) == 24 and [bool(row.hazards) for row in rows] == [True] * 5 + [False] * 19
    some, left = worst_results(run, "t_h3 > 4", 2)
    assert left == 5 and some == rows[:2]
    none, zero = worst_results(run, 'outcome == "masked" and t_h3 > 4')
    assert (none, zero) == ([], 0)
