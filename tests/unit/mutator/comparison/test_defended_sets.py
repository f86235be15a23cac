"""Pairs of sets of defences that cause hazards without a fault."""

from types import SimpleNamespace
from typing import Any

import pytest

from mutator.comparison import defended_sets
from mutator.comparison.defended_pairs import PairOutcome, pair_of
from mutator.comparison.defended_sets import DefendedSet
from mutator.comparison.defended_sheets import prevented_share
from mutator.model import Outcome, Status
from mutator.results.hazards_caused_by_defences import caused_golden_hazards
from mutator.store.golden_runs import GoldenRun

from .test_defended_pairs import OBSERVE_S, OVER, facts, row

H1, H4 = ("H1", 5.0), ("H4", 1.8)


def rows_with(
    monkeypatch: pytest.MonkeyPatch, outcome: Outcome, in_record: tuple[Any, ...], usual: tuple[Any, ...] = ()
) -> Any:
    """Return the row of a defended experiment of S2, whose golden run has H4."""
    monkeypatch.setattr(GoldenRun, "for_experiment", lambda *_, **__: SimpleNamespace(key="S2"))
    record = SimpleNamespace(status=Status.OK, outcome=outcome, golden_hazards=in_record)
    folder = SimpleNamespace(
        golden_hazards={"S2": (H4,)}, records=lambda: {"x": record}, has_seeded_goldens=False
    )
    run = SimpleNamespace(
        folder=folder, experiments=[SimpleNamespace(id="x")], row_by_id={"x": row((), outcome=outcome)}
    )
    undefended: Any = SimpleNamespace(golden_hazards={"S2": usual} if usual else {})
    return defended_sets._rows_with_caused_hazards(undefended, run)["x"]  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("outcome", "in_record", "hazards"),
    [
        (Outcome.SDC, (H4,), (H4,)),
        (Outcome.NOT_ACTIVATED, (), (H4,)),
        (Outcome.NOT_JUDGED, (H1, H4), (H4, H1)),
    ],
)
def test_a_hazard_that_a_defence_causes_without_a_fault_counts_in_pairs(
    monkeypatch: pytest.MonkeyPatch, outcome: Outcome, in_record: tuple[Any, ...], hazards: tuple[Any, ...]
) -> None:
    """Otherwise the collision that it replaces would be prevented."""
    defended = rows_with(monkeypatch, outcome, in_record)
    assert defended.hazards == hazards
    assert pair_of(row(()), defended, facts(**OVER), OBSERVE_S).outcome is PairOutcome.CAUSED
    assert pair_of(row((("H3", 6.0),)), defended, facts(**OVER), OBSERVE_S).outcome is PairOutcome.REPLACED


@pytest.mark.parametrize("outcome", [Outcome.SDC, Outcome.NOT_JUDGED])
def test_a_hazard_that_the_golden_run_has_anyway_is_not_caused(
    monkeypatch: pytest.MonkeyPatch, outcome: Outcome
) -> None:
    assert rows_with(monkeypatch, outcome, (H4,), usual=(H4,)).hazards == ()


def test_golden_runs_with_one_more_hazard_are_told() -> None:
    """Also where the undefended run has another one."""
    undefended: Any = SimpleNamespace(golden_hazards={"S1": (H1,), "S2": (H1,)})
    defended: Any = SimpleNamespace(golden_hazards={"S1": (H1, H4), "S2": (H1,)})
    assert caused_golden_hazards(undefended, defended) == {"S1": (H4,)}


@pytest.mark.parametrize(("sizes", "rate"), [(None, 0.5), ((30, 10), 0.75)])
def test_the_prevented_share_of_a_sample_is_weighted(sizes: tuple[int, int] | None, rate: float) -> None:
    """The prevented hazard is in the larger stratum, and so stands for more of the plan."""
    before = [row((H1,), experiment_id=name, variant=name) for name in "ab"]
    after = [row(()), row((H1,))]
    strata = {name: ((name,), size) for name, size in zip("ab", sizes, strict=True)} if sizes else None
    undefended: Any = SimpleNamespace(stratum_by_id=strata)
    defended = DefendedSet(
        name="brake",
        undefended=undefended,
        defended=undefended,
        pairs=tuple(pair_of(b, a, facts(**OVER), OBSERVE_S) for b, a in zip(before, after, strict=True)),
        golden_activities=(),
        caused_goldens=(),
    )
    share = prevented_share(defended)
    assert (share.count, share.of, share.rate) == (1, 2, rate)
