"""A command killed at any moment reaches the same results when repeated and leaves no process."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import pytest

from mutator.workspace import Workspace

from .scenes import CLONE, SHIPPED_RUN, scenes
from .tally import Tally

pytestmark = pytest.mark.slow

TRIES = {
    "run": 45,
    "run with checks": 20,
    SHIPPED_RUN: 6,
    "report": 20,
    "repair": 20,
    "merge": 20,
}  # of up to three kills each


@pytest.mark.parametrize("name", TRIES)
def test_a_command_killed_at_any_moment_completes(
    name: str,
    toy: Workspace,
    tmp_path: Path,
    kept_checks: None,
    seeds: Callable[[int], Sequence[int]],
    print_tally: Callable[[Tally], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("MUTATOR_ROOT", str(CLONE if name == SHIPPED_RUN else toy.library.parent))
    monkeypatch.chdir(tmp_path)
    scene = next(one for one in scenes(toy, tmp_path / "homes", tmp_path / "case") if one.name == name)
    right, wanted = scene.undisturbed(), seeds(TRIES[name])
    tally = Tally(f"kills of {name}")
    tally.drive(wanted, partial(scene.cases, right))
    print_tally(tally)
    assert not tally.wrong
    assert len(tally.cases) >= len(wanted)  # most kills came in time
