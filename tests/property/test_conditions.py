"""Conditions: one canonical text, and a decision for every observation."""

import ast

from hypothesis import given, settings
from hypothesis import strategies as st

from mutator.errors import MutatorError
from mutator.triggers.conditions import VARIABLES, check_condition, evaluate, to_code

NUMBERS = st.integers(-100, 100).map(str) | st.floats(0, 1e300).map(repr) | st.sampled_from(VARIABLES)
TERMS = st.recursive(
    NUMBERS,
    lambda inner: (
        st.tuples(st.sampled_from(["({} + {})", "{} * ({})", "({} - {})", "max({}, {})"]), inner, inner).map(
            lambda p: p[0].format(p[1], p[2])
        )
        | st.tuples(st.sampled_from(["(-{})", "abs({})"]), inner).map(lambda p: p[0].format(p[1]))
    ),
    max_leaves=6,
)
COMPARISONS = st.tuples(TERMS, st.sampled_from(["<", "<=", ">", ">=", "==", "!="]), TERMS).map(" ".join)
CONDITIONS = st.recursive(
    COMPARISONS,
    lambda inner: st.tuples(
        st.sampled_from(["({} and {})", "({}) or {}", "not ({} or {})"]), inner, inner
    ).map(lambda p: p[0].format(p[1], p[2])),
    max_leaves=5,
)
OBSERVED = st.fixed_dictionaries({name: st.floats(allow_nan=True, allow_infinity=True) for name in VARIABLES})


@settings(max_examples=200, deadline=None)
@given(CONDITIONS, OBSERVED)
def test_canonical_text_means_the_same(text: str, values: dict[str, float]) -> None:
    """The canonical text is stable and decides exactly as the text it comes from."""
    try:
        canonical = check_condition(text)
    except MutatorError as error:
        assert "characters" in str(error)
        return
    assert check_condition(canonical) == canonical
    plain = eval(text, {"__builtins__": {}, "abs": abs, "max": max}, values)
    assert evaluate(canonical, values) == bool(plain)


@settings(max_examples=200, deadline=None)
@given(CONDITIONS, TERMS, TERMS, OBSERVED)
def test_no_observation_raises(text: str, a: str, b: str, values: dict[str, float]) -> None:
    """Division by zero, infinities and NaN give True or False, never an exception."""
    try:
        canonical = check_condition(f"({text}) and ({a}) / ({b}) > 1")
    except MutatorError as error:
        assert "characters" in str(error)
        return
    assert isinstance(evaluate(canonical, values), bool)


@settings(max_examples=300, deadline=None)
@given(st.text(max_size=40) | st.text(alphabet="hwt rs<=>()[].'_+-*/0123456789,:andort", max_size=40))
def test_any_text_is_answered(text: str) -> None:
    """Whatever is typed is a condition of the few allowed kinds, or a MutatorError."""
    try:
        code = to_code(check_condition(text))
    except MutatorError:
        return
    names = {node.id for node in ast.walk(ast.parse(code)) if isinstance(node, ast.Name)}
    assert names <= {*VARIABLES, "abs", "min", "max", "_div"}
    assert not any(
        isinstance(n, ast.Attribute | ast.Subscript | ast.Lambda) for n in ast.walk(ast.parse(code))
    )


def test_infinite_headway_is_more_than_any() -> None:
    """At standstill every finite headway is exceeded."""
    assert evaluate("hwt > 1e308", {"t": 0.0, "d_rel": 5.0, "v_ego": 0.0, "v_lead": 1.0})
