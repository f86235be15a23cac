"""The columns that say what defences did."""

from types import SimpleNamespace
from typing import Any

from mutator.model import DefenceActivity
from mutator.results.columns_of_defences import ACTIVATIONS, COLUMNS_OF_EVERY_DEFENCE, CONFLICTS


def test_a_step_in_which_two_defences_disagree_counts_once() -> None:
    """Both count it in their reports; activations are of each."""
    activities = [
        DefenceActivity(name=name, first=1.0, last=2.0, activations=2, steps=9, conflicts=3, commands=())
        for name in ("a", "b")
    ]
    finished: Any = SimpleNamespace(is_ok=True, record=SimpleNamespace(defences=activities))
    cells = {c.name: c for c in COLUMNS_OF_EVERY_DEFENCE if c.name in (ACTIVATIONS, CONFLICTS)}
    assert {name: column.cell_of(finished) for name, column in cells.items()} == {
        ACTIVATIONS: 4,
        CONFLICTS: 3,
    }
