"""`mutator shrink`, on a finished run of the toy target."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from .finished_runs import experiment_with

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json


def test_shrink_prints_the_smallest_form_and_how_to_try_it(cli: Cli, run: Path, tmp_path: Path) -> None:
    """As text and as JSON, which agree; the second command repeats nothing."""
    words = ("shrink", experiment_with(run, "hazard"), "--run", run, "--out", tmp_path / "smaller", "-n", "1")
    facts = cli(*words, "--json").json
    assert facts["hazard"] == "H3"
    assert "without the hazard" in facts["minimal"]
    answer = cli(*words)
    assert answer.code == 0, answer.err
    for text in (facts["experiment"], facts["minimal"].partition(";")[0], *facts["commands"]):
        assert text in answer.out
    assert cli(*facts["commands"][0].split()[1:]).code == 0


def test_shrink_refuses_an_experiment_without_a_hazard(cli: Cli, run: Path) -> None:
    """In one sentence, with exit code 2."""
    answer = cli("shrink", experiment_with(run, "sdc"), "--run", run)
    assert answer.code == 2
    assert "reached no hazard (sdc)" in answer.err
