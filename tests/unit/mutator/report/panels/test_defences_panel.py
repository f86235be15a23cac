"""The sentences about sets of defences."""

from types import SimpleNamespace
from typing import Any

import pytest

from mutator.comparison.defended_pairs import DefendedPair, PairOutcome, pair_of
from mutator.comparison.defended_sets import DefendedSet, GoldenActivity
from mutator.comparison.defended_sheets import defence_sheets
from mutator.model import DefenceActivity, Status
from mutator.report.defence_sentences import describe_sets
from mutator.report.panels import defences_panel
from mutator.results.result_rows import ResultRow
from tests.unit.mutator.comparison.test_defended_pairs import H1, OBSERVE_S, OVER, facts, row

CRASHED: dict[str, Any] = {"status": Status.CRASHED, "outcome": None}


def pair(before: ResultRow, after: ResultRow) -> DefendedPair:
    return pair_of(before, after, facts(**OVER), OBSERVE_S)


def run_of(rows: list[ResultRow], **head: Any) -> SimpleNamespace:
    """A run with these results of a target without metrics."""
    facts_of_target = {"metrics": (), "severity": None, "hazards": ("H1",)} | head
    return SimpleNamespace(
        stratum_by_id=None,
        folder=SimpleNamespace(head=SimpleNamespace(**facts_of_target)),
        experiments=[SimpleNamespace(id=row.experiment_id) for row in rows],
        row_by_id={row.experiment_id: row for row in rows},
        metrics_by_id={},
    )


def set_of(name: str, *pairs: DefendedPair, **given: Any) -> DefendedSet:
    usual: dict[str, Any] = {
        "undefended": run_of([pair.undefended for pair in pairs]),
        "defended": run_of([pair.defended for pair in pairs]),
        "golden_activities": (),
        "caused_goldens": (),
    }
    return DefendedSet(name=name, pairs=pairs, **usual | given)


def prevented(**of_row: Any) -> DefendedPair:
    return pair(row(H1, **of_row), row(()))


def unchanged(**of_row: Any) -> DefendedPair:
    return pair(row(H1, **of_row), row(H1, **of_row))


def text_of(*sets: DefendedSet) -> str:
    return "\n".join(describe_sets(sets, 0.01))


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
    assert "`a` acts in 1 fault-free drive, and in none of 0 experiments" in text_of(defended)


def test_sets_that_prevent_nothing_are_named_with_what_they_leave_open_and_cost() -> None:
    """Each that leaves something open or acts needlessly; equal numbers share a sentence."""
    still_open = pair_of(row(H1), row(()), facts(after_fault_s=1.0), OBSERVE_S)
    needless = pair(row(()), row(()))
    text = text_of(
        set_of("a", still_open, needless), set_of("b", still_open, needless), set_of("c", unchanged())
    )
    assert text.startswith(
        "No set prevents any hazard.\n"
        "With `a` and `b`, no hazard comes in 1 of 1 experiment that had one without defences, but the drive "
        "ends too early to call it prevented.\n"
        "`a` and `b` each act in no fault-free drive, and in 1 of 1 experiment that had no hazard without "
        "defences.\n"
        "`c` acts in no fault-free drive, and in none of 0 experiments"
    )


def test_most_is_more_than_half() -> None:
    """A set that prevents less than half of the worst is only better than the others."""
    few = [prevented(severity="S3"), *[unchanged(severity="S3")] * 2]
    text = text_of(set_of("a", *few), set_of("b", unchanged(severity="S3")))
    assert "`a` prevents the most of the worst hazards (severity S3): 1 of 3.\n" in text
    assert "Of all hazards, `a` prevents 33.3 % (1/3;" in text
    assert "`a` prevents 1 of 3 of the worst hazards (severity S3)." in text_of(set_of("a", *few))
    many = [prevented(severity="S3"), prevented(severity="S3"), unchanged(severity="S3")]
    assert "Most of the worst hazards (severity S3) are prevented by `a` (2 of 3)." in text_of(
        set_of("a", *many)
    )
    half = [prevented(), unchanged()]
    assert "Most of" not in text_of(set_of("a", *half), set_of("b", *half))
    assert "All of the hazards are prevented by `a` (1 of 1)." in text_of(set_of("a", prevented()))


def test_sets_that_tie_are_all_named() -> None:
    """By the worst hazards; the one that prevents more of all comes first. Then with the cost of each."""
    worst, mild = prevented(severity="S3"), prevented(severity="S1")
    others = [unchanged(severity="S3")] * 2
    text = text_of(
        set_of("a", worst, *others, unchanged(severity="S1")),
        set_of("b", worst, *others, mild),
        set_of("c", *others),
    )
    assert "`b` and `a` prevent the most of the worst hazards (severity S3): 1 of 3 each.\n" in text
    assert "Of all hazards, `b` prevents 50.0 % (2/4;" in text and "`a` prevents 25.0 % (1/4;" in text
    assert "`b` and `a` each act in no fault-free drive" in text and "`c`" not in text
    text = text_of(set_of("a", worst), set_of("b", worst))
    assert "are prevented by `a` (1 of 1) and by `b` (1 of 1)." in text
    text = text_of(set_of("a", unchanged(severity="S3"), mild), set_of("b", unchanged(severity="S3"), mild))
    assert "No set prevents any of the worst hazards (severity S3).\n" in text
    assert "Of all hazards, the most are prevented by `a`, 50.0 % (1/2;" in text
    assert "), and by `b`, 50.0 % (1/2;" in text


@pytest.mark.parametrize(("step_s", "length"), [(0.01, "one step, here 10 ms,"), (None, "one step,")])
def test_the_latency_is_said(step_s: float | None, length: str) -> None:
    *_, last = describe_sets([set_of("a", prevented())], step_s)
    assert f"that latency, {length} is part of its reaction time" in last


def test_outcomes_are_defined_beside_their_table() -> None:
    """Each column with an outcome."""
    sheet = defence_sheets([set_of("a", prevented())], ["H1"])[0]
    outcomes = {outcome.words for outcome in PairOutcome} & {*sheet.heads}
    assert len(outcomes) == 8
    assert all(f"*{word.capitalize()}*: " in sheet.note for word in outcomes)


def test_a_long_table_of_activations_is_shortened() -> None:
    """To the first of each set; the note says where all are."""
    needless = [pair(row((), experiment_id=f"{number}"), row(())) for number in range(30)]
    sheets = {s.name: s for s in defence_sheets([set_of(name, *needless) for name in "ab"], ["H1"])}
    short = defences_panel._shortened(sheets["unneeded_activations"])
    assert [line[0] for line in short.lines] == ["a"] * 20 + ["b"] * 20
    assert "all 60 are in `tables/unneeded_activations.csv`" in short.note
    assert defences_panel._shortened(sheets["defended_pairs"]) is sheets["defended_pairs"]
