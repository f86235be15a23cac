"""A reader of a damaged run folder returns the right result, or an error that names the file and the
remedy."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from mutator.workspace import Workspace

from .run_folders import BUILDERS
from .tally import Tally

pytestmark = pytest.mark.slow

CLONE = Path(__file__).parents[2]
TRIES = {"finished": 500, "forged": 150, "half": 150, "shards": 120, "shipped": 80, "shipped_half": 40}


@pytest.mark.parametrize("name", TRIES)
def test_no_damage_misleads_a_reader(
    name: str,
    toy: Workspace,
    tmp_path: Path,
    kept_checks: None,
    seeds: Callable[[int], Sequence[int]],
    print_tally: Callable[[Tally], None],
    reseal: Callable[..., None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("MUTATOR_ROOT", str(CLONE if name.startswith("shipped") else toy.library.parent))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "home").mkdir()
    world = BUILDERS[name](tmp_path / "home", tmp_path / "case")
    if name == "forged":
        world = replace(world, reseal=reseal)
    tally = Tally(f"damages to run folders: {name}")
    tally.drive(seeds(TRIES[name]), world.cases)
    print_tally(tally)
    assert not tally.wrong
