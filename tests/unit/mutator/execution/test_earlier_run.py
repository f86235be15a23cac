"""The run folder of `--since` and `--last-failed`: what it must be, what is told of it, and what runs."""

import dataclasses
import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator import MutatorError
from mutator.execution import earlier_run
from mutator.execution.earlier_run import describe_left_out
from mutator.execution.session_summary import Summary
from mutator.model import Outcome
from mutator.workspace import Workspace

pytestmark = [
    pytest.mark.usefixtures("kept_checks"),
    pytest.mark.filterwarnings("ignore:no golden run reaches the trigger"),
]
Run = Callable[..., Summary]


@pytest.mark.skipif(hasattr(sys, "monitoring"), reason="Python 3.12 and later can tell what runs execute")
def test_an_older_python_runs_everything_and_says_so(tmp_path: Path, run: Run) -> None:
    run("base")
    summary = run("new", since=tmp_path / "base")
    assert summary.left_out == 0
    assert summary.since_note == (
        "since base: 0 of 12 left out: Python 3.11 cannot tell what a run executes, as Python 3.12 can"
    )


def test_a_sentence_lists_the_most_frequent_reasons() -> None:
    reasons = {"a changed": 1, "b changed": 4, "c changed": 2, "d changed": 1, "e changed": 1}
    assert describe_left_out(3, reasons) == (
        "3 of 12 left out, because nothing that they executed has changed; the others ran: "
        "b changed (4), c changed (2), a changed (1), other reasons (2)"
    )


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ({"since": "new"}, "the folder of this run itself"),
        ({"since": "nowhere"}, "not a run folder"),
        ({"since": "base", "reuse": False}, "`since` without `reuse`"),
        ({"since": "base", "cluster": "local:2"}, "`since` with `cluster`"),
    ],
)
def test_a_useless_earlier_run_is_refused(
    toycar: Workspace, tmp_path: Path, arguments: dict[str, Any], match: str
) -> None:
    arguments["since"] = tmp_path / str(arguments["since"])
    with pytest.raises(MutatorError, match=match):
        mutator.run("small", tmp_path / "new", workspace=toycar, **arguments)
    assert not (tmp_path / "new").exists()


def test_an_earlier_run_of_another_target_is_refused(toycar: Workspace, tmp_path: Path, run: Run) -> None:
    run("base")
    head = tmp_path / "base" / "run.json"
    values = json.loads(head.read_text())
    shutil.copytree(tmp_path / "base", tmp_path / "other")
    other = mutator.load_run(tmp_path / "other").folder
    with pytest.raises(MutatorError, match="a run of the target pole"):
        earlier = earlier_run.EarlierRunUse(since=_with_target(other, "pole"))
        earlier.check_target(mutator.load_run(tmp_path / "base").folder)
    assert values["target"] == "toycar"


def _with_target(folder: Any, target: str) -> Any:
    folder.__dict__["head"] = dataclasses.replace(folder.head, target=target)
    return folder


class TestLastFailed:
    """`last_failed` runs what had a hazard or did not end normally."""

    def test_what_failed_runs_first(self, tmp_path: Path, run: Run) -> None:
        """The rest is left for the next call, which completes the run: the same seal as in one run."""
        base = run("base")
        first = run("new", since=tmp_path / "base", last_failed=True)
        assert (first.done, first.unselected, first.exit_code) == (3, 9, 0)
        assert first.selection_note == (
            "not selected by --last-failed: 9; without it, the same command runs them"
        )
        records = mutator.load_run(tmp_path / "new").folder.records()
        assert {record.outcome for record in records.values()} == {Outcome.HAZARD}
        assert first.seal is None
        second = run("new", since=tmp_path / "base")
        assert (second.done, second.unselected, second.seal) == (12, 0, base.seal)

    def test_without_an_earlier_run_the_own_folder_counts(self, tmp_path: Path, run: Run) -> None:
        """If nothing has failed there, everything runs, as with pytest."""
        summary = run("new", last_failed=True)
        assert (summary.done, summary.unselected) == (12, 0)
