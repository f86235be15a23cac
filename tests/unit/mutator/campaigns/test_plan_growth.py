"""The plan of a bench."""

import json
from pathlib import Path
from typing import Any

import pytest

from mutator.campaigns.plan_growth import BatchChain
from mutator.store import plan_file


def write_batches(run: Path, *sizes: int) -> Path:
    (run / "plan").mkdir()
    chain = BatchChain()
    path = run / plan_file.BATCHES_FILE
    path.write_bytes(b"".join(chain.line_of_next(size, f"of {size}") for size in sizes))
    assert plan_file.last_batch_digest(run) == chain.last_digest
    return path


def test_batches_are_a_chain(tmp_path: Path) -> None:
    """Each line follows from the one before, and all add up to the plan."""
    write_batches(tmp_path, 2, 1, 4)
    assert list(plan_file.batch_problems(tmp_path, 7)) == []
    [problem] = plan_file.batch_problems(tmp_path, 8)
    assert "batches of 7 experiments" in str(problem) and "expected 8" in str(problem)


def test_a_changed_reason_breaks_the_chain(tmp_path: Path) -> None:
    """Nobody can change a border or a reason without the digest of the last line."""
    path = write_batches(tmp_path, 2, 1, 4)
    digest = plan_file.last_batch_digest(tmp_path)
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([lines[0], lines[1].replace("of 1", "at will"), lines[2]]))
    [problem] = plan_file.batch_problems(tmp_path, 7)
    assert problem.line == 3 and "does not follow" in str(problem)
    path.write_text("".join([*lines[:2], json.dumps(json.loads(lines[2]) | {"reason": "none"}) + "\n"]))
    assert plan_file.last_batch_digest(tmp_path) != digest


@pytest.mark.parametrize(
    "change",
    [{"experiments": "2"}, {"experiments": 2.0}, {"experiments": True}, {"batch": True}, {"reason": 1}],
)
def test_a_value_of_another_type_is_a_problem(tmp_path: Path, change: dict[str, Any]) -> None:
    """What only looks like a count is no batch."""
    path = write_batches(tmp_path, 2)
    path.write_text(json.dumps(json.loads(path.read_text()) | change) + "\n")
    [problem] = plan_file.batch_problems(tmp_path, 2)
    assert problem.line == 1


def test_a_line_that_is_no_batch_is_a_problem(tmp_path: Path) -> None:
    """Damage is reported with its line."""
    path = write_batches(tmp_path, 2)
    path.write_text("[]\n")
    [problem] = plan_file.batch_problems(tmp_path, 2)
    assert problem.line == 1
