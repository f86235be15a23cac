"""The conditions of triggers."""

import math

import pytest

from mutator.errors import MutatorError
from mutator.triggers.conditions import (
    canonical_condition,
    canonical_formula,
    divide,
    evaluate_condition,
    names_in,
    to_python_source,
)

FOLLOWING = {"t": 3.0, "d_rel": 40.0, "v_ego": 20.0, "v_lead": 18.0, "hwt": 2.0, "rs": 2.0}


@pytest.mark.parametrize(
    ("text", "canonical"),
    [
        ("hwt<=2", "hwt <= 2.0"),
        ("hwt <= safe and rs>0", "hwt <= 3.0 and rs > 0.0"),
        ("not (t > 1 or t < -2)", "not (t > 1.0 or t < -2.0)"),
        ("1 <= hwt < 2", "1.0 <= hwt < 2.0"),
        (
            "abs(rs) + min(1, t) * 2 > max(d_rel, 3, 4)",
            "(abs(rs) + (min(1.0, t) * 2.0)) > max(d_rel, 3.0, 4.0)",
        ),
        (" True ", "True"),
    ],
)
def test_equal_conditions_have_one_canonical_text(text: str, canonical: str) -> None:
    assert canonical_condition(text, {"safe": 3}) == canonical
    assert canonical_condition(canonical) == canonical


@pytest.mark.parametrize(
    ("text", "piece"),
    [
        ("hwt", "is not a truth value"),
        ("hwt + 1", "is not a truth value"),
        ("(hwt > 1) + 1 > 0", "'hwt > 1'"),
        ("speed > 1", "unknown name 'speed'"),
        ("__import__('os').system('x') > 1", "a call of '__import__('os').system'"),
        ("().__class__ > 1", "'().__class__'"),
        ("t ** 2 > 1", "'t ** 2'"),
        ("t in (1, 2)", "'t in (1, 2)'"),
        ("'a' > t", "'a'"),
        ("[t for t in x] > 1", "'[t for t in x]'"),
        ("(lambda: 1)() > 0", "a call of 'lambda: 1'"),
        ("t > 1; t", "invalid syntax"),
        ("t >", "invalid syntax"),
        ("min(t) > 1", "min with 1 argument in"),
        ("abs(t, 1) > 1", "abs with 2 arguments"),
        ("max(*t) > 1", "a call of 'max'"),
        ("t > 1e999", "a number that is too large"),
        ("t > 1j", "1j"),
        ("t > " + "1" * 2000, "characters"),
        ("t" + "+t" * 400 + " > 0", "characters"),
        ("-" * 980 + "t > 0", "too many nested operations"),
    ],
)
def test_only_comparisons_of_observed_values_are_conditions(text: str, piece: str) -> None:
    with pytest.raises(MutatorError) as caught:
        canonical_condition(text, variables=FOLLOWING)
    assert piece in str(caught.value)


def test_no_comparison_of_a_missing_value_holds() -> None:
    assert evaluate_condition("hwt == 2 and rs == 2", FOLLOWING)
    assert not evaluate_condition("gap > 1", FOLLOWING) and not evaluate_condition("gap <= 1", FOLLOWING)


@pytest.mark.parametrize(
    ("text", "canonical", "code"),
    [
        (
            "d_rel / v_ego if v_ego > 0 else inf",
            "(d_rel / v_ego) if v_ego > 0.0 else inf",
            "_div(d_rel, v_ego) if v_ego > 0.0 else math.inf",
        ),
        ("hypot(t, rs)", "hypot(t, rs)", "math.hypot(t, rs)"),
        ("-abs(rs)", "-abs(rs)", "-abs(rs)"),
    ],
)
def test_formulas_have_a_canonical_text_and_code_that_cannot_raise(
    text: str, canonical: str, code: str
) -> None:
    assert canonical_formula(text, FOLLOWING) == canonical_formula(canonical, FOLLOWING) == canonical
    assert to_python_source(canonical, is_formula=True) == code


@pytest.mark.parametrize("text", ["t > 1", "gap", "1 if t else 2", "(1 if t > 0 else 2) + 1", "hypot(t)"])
def test_an_invalid_formula_is_refused(text: str) -> None:
    with pytest.raises(MutatorError):
        canonical_formula(text, FOLLOWING)


def test_names_come_in_the_order_of_the_text() -> None:
    assert names_in("rs > 0.0 and min(hwt, inf) < abs(rs) or True") == ("rs", "hwt")


@pytest.mark.parametrize(
    ("a", "b", "result"), [(1.0, 0.0, math.inf), (-1.0, 0.0, -math.inf), (1.0, -0.0, -math.inf)]
)
def test_division_by_zero_is_infinite(a: float, b: float, result: float) -> None:
    """With IEEE 754, every condition is either true or false."""
    assert divide(a, b) == result
    assert math.isnan(divide(0.0, b))
    assert evaluate_condition("1 / t > 5", {**FOLLOWING, "t": 0.0})
    assert to_python_source("1 / t > 5") == "_div(1.0, t) > 5.0"
