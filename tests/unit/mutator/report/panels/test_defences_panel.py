"""The sentences about sets of defences."""

from types import SimpleNamespace
from typing import Any

from mutator.comparison.defended_pairs import DefendedPair, pair_of
from mutator.comparison.defended_sets import DefendedSet, GoldenActivity
from mutator.comparison.defended_sheets import defence_sheets
from mutator.model import DefenceActivity, Status
from mutator.report.panels import defences_panel
from mutator.results.result_rows import ResultRow
from tests.unit.mutator.comparison.test_defended_pairs import H1, OBSERVE_S, OVER, facts, row

CRASHED: dict[str, Any] = {"status": Status.CRASHED, "outcome": None}


def pair(before: ResultRow, after: ResultRow) -> DefendedPair:
    return pair_of(before, after, facts(**OVER), OBSERVE_S)


def set_of(name: str, *pairs: DefendedPair, **given: Any) -> DefendedSet:
    empty: dict[str, Any] = {
        "undefended": SimpleNamespace(stratum_by_id=None),
        "defended": SimpleNamespace(),
        "golden_activities": (),
    }
    return DefendedSet(name=name, pairs=pairs, **empty | {"caused_goldens": ()} | given)


def text_of(*sets: DefendedSet) -> str:
    return "\n".join(defences_panel._sentences(sets))


def test_runs_that_cannot_be_compared_are_told() -> None:
    """They do not make hazards disappear: neither those of one set nor those of all."""
    lost, kept = pair(row(H1), row((), **CRASHED)), pair(row(H1), row(H1))
    text = text_of(set_of("a", lost))
    assert "No undefended run has a hazard" not in text
    assert "With `a`, 1 run of experiments with a hazard cannot be compared." in text
    assert "No set prevents any hazard." in text_of(set_of("a", lost), set_of("b", kept))
    assert "No undefended run has a hazard" in text_of(set_of("a", pair(row(()), row(()))))
    sheet = defence_sheets([set_of("a", lost)], ["H1"])[0]
    cells = dict(zip(sheet.heads, sheet.lines[0], strict=True))
    assert (cells["hazards"], cells["not compared"]) == (0, 1)


def test_a_set_that_is_not_finished_is_told() -> None:
    text = text_of(set_of("a", pair(row(H1), row(())), missing_count=2))
    assert "`a` is not finished: 2 experiments without a result are left out." in text


def test_two_defences_in_a_drive_are_a_false_activation_of_this_drive() -> None:
    activity = DefenceActivity(
        name="x", first=1.0, last=2.0, activations=1, steps=2, conflicts=0, commands=()
    )
    activities = tuple(GoldenActivity("S2", activity, (), ()) for _ in range(2))
    defended = set_of("a", pair(row(H1), row(())), golden_activities=activities)
    assert "It also acts in 1 fault-free drive," in text_of(defended)
