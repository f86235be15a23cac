"""The proof that a table's contexts cover everything exactly once."""

import pytest

from mutator.stpa.context_coverage_proof import measure_coverage
from mutator.triggers.conditions import canonical_condition


def prove(*conditions: str):
    return measure_coverage({f"C{i}": canonical_condition(text) for i, text in enumerate(conditions, 1)})


@pytest.mark.parametrize(
    "conditions",
    [
        ("True",),
        ("hwt <= 2", "not hwt <= 2"),
        ("hwt < 2", "hwt == 2", "hwt > 2"),
        ("-1 <= rs <= 1", "rs < -1 or rs > 1"),
        ("2 >= hwt and rs <= 0", "hwt <= 2 and 0 < rs", "hwt > 2"),
        ("v_ego < 0.3", "v_ego >= 0.3 and hwt <= 2", "v_ego >= 0.3 and hwt > 2"),
    ],
)
def test_a_table_that_covers_everything_once_is_accepted(conditions: tuple[str, ...]) -> None:
    found = prove(*conditions)
    assert (found.no_proof_reason, found.first_gap_or_overlap) == (None, None)
    assert found.cell_count > 0


@pytest.mark.parametrize(
    ("conditions", "place", "rows"),
    [
        (("hwt < 2", "hwt > 2"), "hwt = 2.0", ()),
        (("hwt <= 2", "hwt >= 2"), "hwt = 2.0", ("C1", "C2")),
        (("hwt <= 2", "2 < hwt <= 3"), "hwt > 3.0", ()),
        (("hwt <= 2", "hwt > 2 and rs > 0"), "hwt > 2.0 and rs < 0.0", ()),
        (("hwt <= 2", "hwt > 1"), "1.0 < hwt < 2.0", ("C1", "C2")),
        (("True", "rs > 0"), "rs > 0.0", ("C1", "C2")),
        (("False",), "any observation", ()),
        (("t >= -1",), "t < -1.0", ()),
    ],
)
def test_the_first_wrong_cell_is_named(
    conditions: tuple[str, ...], place: str, rows: tuple[str, ...]
) -> None:
    """A cell is wrong if it has no context or several."""
    found = prove(*conditions)
    assert (found.first_gap_or_overlap, found.overlapping_rows) == (place, rows)


def test_there_is_no_cell_between_neighbouring_numbers() -> None:
    found = prove("rs <= 1.0", "rs >= 1.0000000000000002")
    assert found.first_gap_or_overlap is None and found.cell_count == 4


@pytest.mark.parametrize("condition", ["rs < v_ego", "rs + 1 > 0", "abs(rs) < 1", "1 < 2"])
def test_other_comparisons_are_not_provable(condition: str) -> None:
    found = prove(condition, f"not {condition}")
    assert (
        found.no_proof_reason is not None
        and "only comparisons of one variable with a constant" in found.no_proof_reason
    )
    assert found.first_gap_or_overlap is None


def test_a_table_with_too_many_cells_is_not_provable() -> None:
    """The limit bounds the time of the proof."""
    names = ("t", "d_rel", "v_ego", "v_lead", "hwt", "rs")
    found = prove(" and ".join(f"{name} != {i}" for name in names for i in range(4)), "True")
    assert found.no_proof_reason is not None and "531441 cells" in found.no_proof_reason
