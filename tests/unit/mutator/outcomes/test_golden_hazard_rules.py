"""The truth table of runs whose golden run has a hazard, cell by cell."""

from itertools import product

import pytest

from mutator.model import AgainstGolden, ObservedActivation, Outcome
from mutator.outcomes.golden_hazard_rules import DriveHazards, compare_with_golden, drive_hazards_of
from mutator.outcomes.hazard_and_metric_judgement import RunJudgement
from mutator.outcomes.verdict_rules import outcome_of
from mutator.targets.hazard_severity import ClassifiedHazard, SeverityScale

STEP_S = 0.01
BEFORE = ObservedActivation(first=2.0, last=4.0, count=3)
GOLDEN = DriveHazards(times=(("H3", 5.0), ("H1", 8.0)), t_end=8.0, classified=ClassifiedHazard("H1", "S1"))

# golden's H1, at 8 s: missing, earlier, the same, later
H1_TIMES = {"missing": None, "earlier": 7.5, "same": 8.0, "later": 8.5}
# golden's H3, at 5 s
H3_TIMES = {"missing": None, "earlier": 4.5, "same": 5.0, "later": 5.5}


def expected_case(h1: str, h3: str, *, another: bool, worse: bool) -> AgainstGolden:
    """The table of docs/explanation/verdicts.md: the first row that applies."""
    for case, applies in (
        (AgainstGolden.ANOTHER, another),
        (AgainstGolden.EARLIER, "earlier" in (h1, h3)),
        (AgainstGolden.WORSE, worse),
        (AgainstGolden.MISSING, "missing" in (h1, h3)),
        (AgainstGolden.LATER, "later" in (h1, h3)),
    ):
        if applies:
            return case
    return AgainstGolden.SAME


CELLS = list(product(H1_TIMES, H3_TIMES, (False, True), (False, True), (False, True)))


@pytest.mark.parametrize("cell", CELLS, ids=str)
def test_the_case_and_the_outcome_follow_the_truth_table(cell: tuple[str, str, bool, bool, bool]) -> None:
    """Every combination of golden's two hazards, another one, a worse one and a changed actuator."""
    h1, h3, another, worse, manifested = cell
    times = {"H3": H3_TIMES[h3], "H2": 6.0 if another else None, "H1": H1_TIMES[h1]}
    events = tuple(sorted(((n, t) for n, t in times.items() if t is not None), key=lambda event: event[1]))
    worst = ClassifiedHazard(events[-1][0], "S2" if worse else "S1") if events else None
    faulty = DriveHazards(times=events, t_end=times["H1"], classified=worst)
    compared = compare_with_golden(GOLDEN, faulty, BEFORE, step_s=STEP_S)

    case = expected_case(h1, h3, another=another, worse=worse and bool(events))
    assert compared.case is case
    counts = case in (AgainstGolden.ANOTHER, AgainstGolden.EARLIER, AgainstGolden.WORSE)
    assert bool(compared.hazards) is counts
    assert sorted((*compared.hazards, *compared.golden_hazards)) == sorted(events)
    if worse and worst:  # a worse hazard counts, also beside another or an earlier one
        assert worst.hazard in dict(compared.hazards)
    outcome = outcome_of(
        activation=BEFORE,
        t_manifest=3.0 if manifested else None,
        hazards=compared.hazards,
        against_golden=compared.case,
    )
    assert outcome is (Outcome.HAZARD if counts else Outcome.SDC if manifested else Outcome.MASKED)


@pytest.mark.parametrize("manifested", [False, True])
@pytest.mark.parametrize("was_stopped", [False, True])
@pytest.mark.parametrize(
    ("first", "case"),
    [
        (4.99, AgainstGolden.SAME),
        (5.0, AgainstGolden.NOT_BEFORE),
        (5.01, AgainstGolden.NOT_BEFORE),
        (9.0, AgainstGolden.NOT_BEFORE),
    ],
)
def test_a_fault_that_acts_from_goldens_first_hazard_on_is_not_judged(
    first: float, case: AgainstGolden, was_stopped: bool, manifested: bool
) -> None:
    activation = ObservedActivation(first=first, last=9.0, count=1)
    compared = compare_with_golden(GOLDEN, GOLDEN, activation, step_s=STEP_S, was_stopped=was_stopped)
    assert compared.case is case
    assert not compared.hazards
    outcome = outcome_of(
        activation=activation,
        t_manifest=first if manifested else None,
        hazards=compared.hazards,
        against_golden=compared.case,
    )
    judged = Outcome.SDC if manifested else Outcome.MASKED
    assert outcome is (judged if case is AgainstGolden.SAME else Outcome.NOT_JUDGED)


def test_a_fault_that_was_never_active_is_not_judged_only_if_the_run_was_stopped_before() -> None:
    """In a run to its end, it is known that the fault never was."""
    ended = compare_with_golden(GOLDEN, GOLDEN, None, step_s=STEP_S)
    assert ended.case is None
    assert outcome_of(activation=None, t_manifest=None, hazards=()) is Outcome.NOT_ACTIVATED
    stopped = compare_with_golden(GOLDEN, GOLDEN, None, step_s=STEP_S, was_stopped=True)
    assert stopped.case is AgainstGolden.NOT_BEFORE
    outcome = outcome_of(activation=None, t_manifest=None, hazards=(), against_golden=stopped.case)
    assert outcome is Outcome.NOT_JUDGED


@pytest.mark.parametrize(
    ("steps", "case"),
    [
        (-2, AgainstGolden.EARLIER),
        (-1, AgainstGolden.SAME),
        (0, AgainstGolden.SAME),
        (1, AgainstGolden.SAME),
        (2, AgainstGolden.LATER),
    ],
)
def test_one_step_is_the_same_time(steps: int, case: AgainstGolden) -> None:
    golden = DriveHazards(times=(("H1", 800 * STEP_S),), t_end=8.0)
    faulty = DriveHazards(times=(("H1", (800 + steps) * STEP_S),))
    assert compare_with_golden(golden, faulty, BEFORE, step_s=STEP_S).case is case


def test_hazards_after_the_end_of_the_drive_do_not_count() -> None:
    """So a run that stops at its terminal hazard has the same verdict as one that goes on."""
    judged = RunJudgement(hazards=(("H3", 9.0), ("H1", 8.0)), alerts=(), t_end=8.0, metrics=())
    assert drive_hazards_of(judged, None) == DriveHazards(times=(("H1", 8.0),), t_end=8.0)


def test_the_end_of_the_drive_counts_as_goldens_hazard_if_all_came_after_it() -> None:
    judged = RunJudgement(hazards=(("H3", 9.0),), alerts=(), t_end=8.0, metrics=())
    golden = drive_hazards_of(judged, None)
    late = ObservedActivation(first=8.5, last=9.0, count=1)
    assert compare_with_golden(golden, golden, late, step_s=STEP_S).case is AgainstGolden.NOT_BEFORE


def test_a_hazard_with_a_class_is_worse_than_one_without() -> None:
    scale = SeverityScale(name="s", about="", source="", classes=(("S0", 0.0, ""), ("S1", 5.0, "")))
    runs = [
        RunJudgement(hazards=(("H1", 8.0),), alerts=(), t_end=8.0, metrics=metrics)
        for metrics in ((), (("delta_v", 1.0),), (("delta_v", 6.0),))
    ]
    without, mild, severe = (drive_hazards_of(judged, scale) for judged in runs)
    cases = {
        (a.severity, b.severity): compare_with_golden(a, b, BEFORE, step_s=STEP_S).case
        for a, b in product((without, mild, severe), repeat=2)
    }
    worse = {pair for pair, case in cases.items() if case is AgainstGolden.WORSE}
    assert worse == {("", "S0"), ("", "S1"), ("S0", "S1")}
    assert set(cases.values()) == {AgainstGolden.WORSE, AgainstGolden.SAME}
