"""Formulas and conditions as JSON trees."""

import pytest

from mutator.triggers.conditions import canonical_condition, canonical_formula
from mutator.triggers.formula_json import formula_as_json

KNOWN = ("t", "gap", "speed", "hwt", "risk")
DERIVED = {"hwt": "(gap / speed)", "risk": "(1.0 / hwt)"}


@pytest.mark.parametrize(
    ("text", "made"),
    [
        ("gap", "gap"),
        ("-2.2", ["neg", 2.2]),
        ("+gap * 2", ["*", "gap", 2.0]),
        ("gap / speed if speed > 0 else inf", ["if", [">", "speed", 0.0], ["/", "gap", "speed"], "inf"]),
        ("hypot(gap, rate(speed))", ["hypot", "gap", ["rate", "speed"]]),
        ("risk", ["/", 1.0, ["/", "gap", "speed"]]),
    ],
)
def test_a_formula_becomes_a_tree_of_operators(text: str, made: object) -> None:
    assert formula_as_json(canonical_formula(text, KNOWN, over_time=True), DERIVED) == made


@pytest.mark.parametrize(
    ("text", "made"),
    [
        ("True", True),
        ("not gap != 3", ["not", ["!=", "gap", 3.0]]),
        (
            "0 < gap <= 9 or ever(t >= 2)",
            ["or", ["and", ["<", 0.0, "gap"], ["<=", "gap", 9.0]], ["ever", [">=", "t", 2.0]]],
        ),
    ],
)
def test_a_chain_of_comparisons_becomes_a_conjunction(text: str, made: object) -> None:
    assert formula_as_json(canonical_condition(text, variables=KNOWN, over_time=True), {}) == made
