"""The frozen plan on disk, read as it was written."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.model import Experiment
from mutator.store import plan_file

Make = Callable[..., Experiment]


def test_a_plan_is_read_as_written(experiment: Make, tmp_path: Path) -> None:
    plan = tuple(experiment(value, changes=("no_lead",)) for value in (1.0, 2.5, 3.0))
    chunks = plan_file.write_plan(tmp_path, plan, (2, 1))
    faults = plan_file.load_faults(tmp_path)
    assert plan_file.load_experiments(tmp_path) == plan
    assert plan_file.load_chunk(tmp_path, chunks[1], faults) == plan[2:]
    assert [*plan_file.experiment_ids(tmp_path)] == [e.id for e in plan]


def test_a_pipe_in_place_of_a_plan_is_refused(tmp_path: Path) -> None:
    """Opening a pipe would wait forever for a writer."""
    (tmp_path / "plan").mkdir()
    os.mkfifo(tmp_path / plan_file.EXPERIMENTS_FILE)
    with pytest.raises(MutatorError, match=r"experiments\.jsonl: cannot be read"):
        list(plan_file.experiment_ids(tmp_path))
