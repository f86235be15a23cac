"""Signal temporal logic, compared with a direct implementation of its definition."""

import logging

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mutator.errors import MutatorError
from mutator.triggers import temporal_logic

pytest.importorskip("rtamt")
STEP = 0.5  # s
Formula = tuple  # (operator, operands)


def formulas() -> st.SearchStrategy[Formula]:
    """Small formulas over x and y, with predicates, connectives, and operators for the past and the
    future."""
    predicate = st.tuples(st.sampled_from(["<=", ">="]), st.sampled_from("xy"), st.integers(0, 4))
    times = st.tuples(st.integers(0, 2), st.integers(0, 2)).map(sorted)

    def larger(small: st.SearchStrategy[Formula]) -> st.SearchStrategy[Formula]:
        return st.one_of(
            st.tuples(st.sampled_from(["and", "or", "implies"]), small, small),
            st.tuples(st.just("not"), small),
            st.tuples(st.sampled_from(["eventually", "always", "once", "historically"]), times, small),
        )

    return st.recursive(predicate, larger, max_leaves=4)


def text(formula: Formula) -> str:
    match formula:
        case ("<=" | ">=" as sign, name, limit):
            return f"({name} {sign} {limit})"
        case ("not", one):
            return f"(not {text(one)})"
        case (("and" | "or" | "implies") as word, one, other):
            return f"({text(one)} {word} {text(other)})"
        case (word, (first, last), one):
            return f"({word}[{first * STEP}:{last * STEP}] {text(one)})"


def far(formula: Formula) -> int:
    match formula:
        case ("<=" | ">=", _, _):
            return 0
        case ("not", one):
            return far(one)
        case ("and" | "or" | "implies", one, other):
            return max(far(one), far(other))
        case (word, (_, last), one):
            return far(one) + (last if word in ("eventually", "always") else 0)


def defined(formula: Formula, i: int, values: dict[str, list[float]]) -> float:
    match formula:
        case ("<=", name, limit):
            return limit - values[name][i]
        case (">=", name, limit):
            return values[name][i] - limit
        case ("not", one):
            return -defined(one, i, values)
        case ("and", one, other):
            return min(defined(one, i, values), defined(other, i, values))
        case ("or", one, other):
            return max(defined(one, i, values), defined(other, i, values))
        case ("implies", one, other):
            return max(-defined(one, i, values), defined(other, i, values))
        case (word, (first, last), one):
            steps = range(first, last + 1)
            at = [i + n if word in ("eventually", "always") else i - n for n in steps]
            found = [defined(one, k, values) for k in at if k >= 0]
            worst = word in ("always", "historically")
            return min(found, default=np.inf) if worst else max(found, default=-np.inf)


@settings(deadline=None, max_examples=300)
@given(formulas(), st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=1, max_size=12))
def test_robustness_equals_the_definition(formula: Formula, rows: list[tuple[int, int]]) -> None:
    """A formula has a value at a step only after its whole window was observed."""
    x, y = (np.array(column, dtype=float) for column in zip(*rows, strict=True))
    time = np.arange(len(rows)) * STEP
    found = temporal_logic.robustness_at_each_step(text(formula), {"t": time, "x": x, "y": y}, STEP)
    ahead = far(formula)
    values = {"x": x.tolist(), "y": y.tolist()}
    expected = [np.inf] * ahead + [defined(formula, i, values) for i in range(len(rows) - ahead)]
    assert found.tolist() == expected[: len(rows)]


def test_a_predicate_and_a_future_operator_can_be_combined() -> None:
    x = np.array([1.0, 6, 6, 6, 6])
    found = temporal_logic.robustness_at_each_step(
        "(x > 5) implies eventually[0,2](x < 5)", {"t": np.arange(5.0), "x": x}, 1.0
    )
    assert found.tolist() == [np.inf, np.inf, 4, -1, -1]


@pytest.mark.parametrize(
    ("step_s", "bound", "steps"), [(1 / 30, "1", 30), (0.01, "0.07", 7), (0.5, "500ms", 1)]
)
def test_bounds_count_whole_steps(step_s: float, bound: str, steps: int) -> None:
    """The length of a step need not have a short decimal form."""
    time = np.arange(40) * step_s
    found = temporal_logic.robustness_at_each_step(
        f"always[0:{bound}](x < 1)", {"t": time, "x": np.zeros(40)}, step_s
    )
    assert found.tolist() == [np.inf] * steps + [1.0] * (40 - steps)


@pytest.mark.parametrize("third", [0.35, 0.1, np.nan])
def test_uneven_steps_are_refused(third: float) -> None:
    """The logic counts steps."""
    values = {"t": np.array([0.0, 0.1, third]), "x": np.zeros(3)}
    with pytest.raises(MutatorError, match=r"a step of \S+ s at 0.1 s.*expected steps of 0.1 s"):
        temporal_logic.robustness_at_each_step("x < 1", values, 0.1)


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("always(x < 3)", r"unbounded always in .*bound the look-ahead"),
        ("once[0:1](eventually(x < 3))", "unbounded eventually"),
        ("historically(xx < 3)", r"unknown name 'xx' in .*expected .*over x, y, t.*correct it"),
        ("speeed < 3", "unknown name 'speeed'"),
        ("x < 3 or", "an unexpected end in 'x < 3 or'"),
        ("(x < 3) ) and y", r"unexpected '\) and y' in"),
        ("always[0:0.7](x < 3)", r"not a multiple of the step, 0.5 s.*use a multiple"),
        ("once[2:1](x < 3)", "an interval that ends before it begins"),
    ],
)
def test_an_invalid_formula_raises_and_prints_nothing(
    formula: str, message: str, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    with caplog.at_level(logging.WARNING), pytest.raises(MutatorError, match=message) as found:
        temporal_logic.check_stl_formula(formula, ["x", "y"], STEP)
    assert "INVALID" not in str(found.value)
    assert (caplog.text, *capfd.readouterr()) == ("", "", "")


@pytest.mark.parametrize("formula", ["1 / (x - 1) < 3", "sqrt(0 - x) < 3", "next(x > 3) or rise(y < 2)"])
def test_a_check_accepts_arithmetic_that_some_values_make_invalid(formula: str) -> None:
    """A check does not know the values."""
    temporal_logic.check_stl_formula(formula, ["x", "y"], STEP)


def test_arithmetic_that_rtamt_cannot_compute_is_reported() -> None:
    with pytest.raises(MutatorError, match="division by zero in '1 / x < 3'"):
        temporal_logic.robustness_at_each_step("1 / x < 3", {"t": np.zeros(1), "x": np.zeros(1)}, STEP)
