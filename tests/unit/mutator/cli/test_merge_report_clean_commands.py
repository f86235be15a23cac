"""What commands print of the results of a run."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

import mutator
from mutator.campaigns.plan import Plan
from mutator.cli.merge_report_clean_commands import print_outcome_counts
from mutator.cli.terminal_output import Terminal
from mutator.workspace import Workspace

NOTE = "**: 2 mutants of operators; left out: all in 1 file that cannot be changed (old.py:2: why)"


def test_a_file_that_operators_could_not_change_is_named_with_the_results(
    toycar: Workspace, tmp_path: Path, write_run: Callable[..., Path], capfd: pytest.CaptureFixture[str]
) -> None:
    def changed(plan: Plan) -> Plan:
        return replace(plan, operator_notes=(NOTE,))

    run = mutator.load_run(write_run(toycar, tmp_path / "run", changed=changed), workspace=toycar)
    print_outcome_counts(Terminal(False, True), run)
    assert NOTE in " ".join(capfd.readouterr().out.split())
