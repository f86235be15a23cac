"""Runs with hardly any usable result: the first broken set-up of a new user."""

from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator.exports import Format
from mutator.model import Experiment, Status
from mutator.store import plan_file
from mutator.workspace import Workspace

from .conftest import Cli

WITHOUT_OUTCOME = {"outcome": None, "activation": None, "trace_digest": "", "max_dev": (), "tree": ""}


def without_outcome(status: Status) -> Callable[[int], dict[str, Any]]:
    return lambda number: WITHOUT_OUTCOME | {"status": status, "detail": "no memory"}


RESULTS: dict[str, Callable[[int], dict[str, Any] | None]] = {
    "only harness errors": without_outcome(Status.HARNESS_ERROR),
    "only crashes": without_outcome(Status.CRASHED),
    "nothing finished": lambda number: None,
    "one row": lambda number: None if number else {},
}


def verbs(run: Path, other: Path, experiment_id: str) -> Iterator[tuple[object, ...]]:
    yield from (("report", run), ("report", run.parent), ("show", "--run", run), ("verify", run))
    yield ("show", experiment_id, "--run", run)
    yield from (("compare", run, other), ("compare", other, run), ("seal", run))
    yield from (("export", run, "--format", name) for name in Format if name != Format.MCAP)


@pytest.mark.parametrize("kind", RESULTS)
def test_a_run_without_usable_results_is_shown_by_every_verb(
    cli: Cli, root: Path, toy: Workspace, tmp_path: Path, write_run: Callable[..., Path], kind: str
) -> None:
    """No verb and no property ends in a traceback, and each states what the run has."""
    numbers = count()

    def result(experiment: Experiment) -> dict[str, Any] | None:
        return RESULTS[kind](next(numbers))

    run = write_run(toy, tmp_path / "runs" / "broken", result, limit=6)
    other = write_run(toy, tmp_path / "runs" / "whole", limit=6)
    for words in verbs(run, other, next(plan_file.experiment_ids(run))):
        answer = cli(*words)
        assert answer.code in (0, 1, 2, 3)
        assert "Traceback" not in answer.err, (words, answer.err)
    opened = mutator.load_run(run)
    assert opened.counts().rows[-1][0] == "total"
    assert opened._repr_html_()
    assert len(opened.results) == {"nothing finished": 0, "one row": 1}.get(kind, 6)
    assert opened.mutation_score().lines == ()
    report = (run / "report" / "REPORT.md").read_text()
    assert ("nan" not in report) and ("NaN" not in report)
