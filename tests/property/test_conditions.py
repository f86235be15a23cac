"""Each condition has one canonical text and is true or false for every observation."""

import ast
import re

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mutator.errors import MutatorError
from mutator.triggers.conditions import (
    canonical_condition,
    canonical_formula,
    evaluate_condition,
    to_python_source,
)
from mutator.triggers.trace_formulas import condition_at_each_step, formula_at_each_step

VARIABLES = ("t", "gap", "speed", "closing")
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
def test_canonical_text_has_the_same_meaning(text: str, values: dict[str, float]) -> None:
    try:
        canonical = canonical_condition(text)
    except MutatorError as error:
        assert "characters" in str(error)
        return
    assert canonical_condition(canonical) == canonical
    plain = eval(text, {"__builtins__": {}, "abs": abs, "max": max}, values)
    assert evaluate_condition(canonical, values) == bool(plain)


@settings(max_examples=200, deadline=None)
@given(CONDITIONS, TERMS, TERMS, OBSERVED)
def test_no_observation_raises(text: str, a: str, b: str, values: dict[str, float]) -> None:
    try:
        canonical = canonical_condition(f"({text}) and ({a}) / ({b}) > 1")
    except MutatorError as error:
        assert "characters" in str(error)
        return
    assert isinstance(evaluate_condition(canonical, values), bool)


@settings(max_examples=300, deadline=None)
@given(st.text(max_size=40) | st.text(alphabet="gap speed<=>()[].'_+-*/0123456789,:andort", max_size=40))
def test_any_text_is_accepted_or_refused(text: str) -> None:
    try:
        code = to_python_source(canonical_condition(text, variables=VARIABLES))
    except MutatorError:
        return
    names = {node.id for node in ast.walk(ast.parse(code)) if isinstance(node, ast.Name)}
    assert names <= {*VARIABLES, "abs", "min", "max", "math", "_div"}
    assert not any(isinstance(n, ast.Subscript | ast.Lambda) for n in ast.walk(ast.parse(code)))


@settings(max_examples=200, deadline=None)
@given(CONDITIONS, st.lists(OBSERVED, min_size=1, max_size=6))
def test_a_trace_gives_the_same_results_as_its_single_steps(text: str, steps: list[dict[str, float]]) -> None:
    try:
        canonical = canonical_condition(text, variables=VARIABLES)
    except MutatorError as error:
        assert "characters" in str(error)
        return
    columns = {name: np.array([step[name] for step in steps]) for name in VARIABLES}
    # the result of min and max depends on the position of a NaN
    if not {"min", "max"} & set(re.findall(r"\w+", text)):
        assert condition_at_each_step(canonical, columns).tolist() == [
            evaluate_condition(canonical, step) for step in steps
        ]


def test_formulas_are_evaluated_over_a_trace() -> None:
    trace = {
        "t": np.array([0.0, 0.5, 1.5]),
        "gap": np.array([3.0, 2.0, -1.0]),
        "v": np.array([0.0, 1.0, 2.0]),
    }
    headway = canonical_formula("gap / v if v > 0 else inf", trace)
    assert formula_at_each_step(headway, trace).tolist() == [np.inf, 2.0, -0.5]
    assert formula_at_each_step(canonical_formula("gap / v", trace), trace).tolist() == [np.inf, 2.0, -0.5]
    rate = formula_at_each_step(canonical_formula("rate(gap)", trace, over_time=True), trace)
    assert np.isnan(rate[0])
    assert rate[1:].tolist() == [-2.0, -3.0]
    past = canonical_condition("ever(v >= 1) and gap < 2", variables=trace, over_time=True)
    assert condition_at_each_step(past, trace).tolist() == [False, False, True]
