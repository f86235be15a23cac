"""No formula, condition or filter takes long or needs much memory."""

from collections.abc import Callable
from contextlib import suppress

import numpy as np
import pytest

from mutator.campaigns.row_filters import compile_filter
from mutator.errors import MutatorError
from mutator.stpa.context_coverage_proof import measure_coverage
from mutator.triggers import temporal_logic
from mutator.triggers.conditions import canonical_condition, canonical_formula
from tests.costs import is_cheap, is_refused

TEMPORAL = {
    "a long past": "once[0,999999999](x < 3)",
    "a long past of all": "historically[0:999999999](x < 3)",
    "a long future": "eventually[0:999999999](x < 3)",
    "a long future of all": "always[0:100000](x < 3)",
    "a long since": "(x < 1) since[0:10000] (x < 2)",
    "a long until": "(x < 1) until[0:10000] (x < 2)",
    "intervals in intervals": "once[0:2000](once[0:2000](x < 3))",
    "a huge number": f"once[0:{'9' * 900}](x < 3)",
    "a long formula": "x < 3" + " and x < 3" * 10_000,
    "deep brackets": "(" * 490 + "x < 3" + ")" * 490,
    "many nots": "not " * 245 + "(x < 3)",
    "a long sum": "x < 1" + "+x" * 450,
}
EXPRESSIONS = {
    "deep brackets": "(" * 495 + "x < 1" + ")" * 495,
    "very deep brackets": "(" * 90_000 + "x < 1" + ")" * 90_000,
    "many signs": "x < " + "-" * 990 + "1",
    "many nots": "not " * 245 + "x < 1",
    "a power": "x < 9 ** 9 ** 9",
    "a shift": "x < 1 << 999999999",
    "a long text": "x < 'a' * 999999999",
    "a huge number": "x < " + "9" * 990,
    "a very huge number": "x < " + "9" * 90_000,
    "a comprehension": "all(x < i for i in range(999999999))",
    "a long sum": "x < 1" + " + 1" * 240,
    "a long chain": "x < 1" + " < x" * 240,
    "calls in calls": "x < " + "abs(" * 195 + "x" + ")" * 195,
    "nested minima": "x < " + "min(x, " * 120 + "x" + ")" * 120,
    "nested events": "ever(" * 150 + "x < 1" + ")" * 150,
    "nested choices": "x < " + "(1 if x < 1 else " * 50 + "2" + ")" * 50,
}


@pytest.mark.parametrize("formula", TEMPORAL.values(), ids=TEMPORAL)
def test_a_hostile_temporal_formula_ends_soon(formula: str) -> None:
    pytest.importorskip("rtamt")
    is_cheap(lambda: temporal_logic.check_stl_formula(formula, ("x",), 0.01))
    steps = np.arange(3000) * 0.01
    is_cheap(lambda: temporal_logic.robustness_at_each_step(formula, {"x": steps, "t": steps}, 0.01))


def test_a_long_interval_is_refused_with_the_longest() -> None:
    pytest.importorskip("rtamt")
    refused = is_refused(lambda: temporal_logic.check_stl_formula(TEMPORAL["a long past"], ("x",), 0.01))
    assert "intervals of 99999999900 steps" in refused or "intervals of 999999999 steps" in refused
    assert "at most 3000 steps together, 30 s here" in refused


CHECKS: dict[str, Callable[[str], object]] = {
    "condition": lambda text: canonical_condition(text, variables=("x",), over_time=True),
    "formula": lambda text: canonical_formula(text, ("x",), over_time=True),
    "filter": lambda text: compile_filter(text, ("x",))({"x": 1}),
    "coverage": lambda text: measure_coverage({"a": canonical_condition(text, variables=("x",))}),
}


@pytest.mark.parametrize("check", CHECKS)
def test_hostile_expressions_end_soon(check: str) -> None:
    is_cheap(lambda: [_ended(check, text) for text in EXPRESSIONS.values()])


def _ended(check: str, text: str) -> None:
    with suppress(MutatorError):
        CHECKS[check](text)


def test_many_cuts_of_a_table_are_not_multiplied() -> None:
    """Cells of 12 variables would be 3 to the power of 12 for each context."""
    names = [f"v{i}" for i in range(12)]
    rows = {f"C{i}": " and ".join(f"{name} < {i}.0" for name in names) for i in range(60)}
    is_cheap(lambda: measure_coverage(rows))
    few = {f"C{i}": " and ".join(f"{name} < {i}.0" for name in names[:3]) for i in range(30)}
    is_cheap(lambda: measure_coverage(few))
