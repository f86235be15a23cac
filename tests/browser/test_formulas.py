"""The page evaluates a manifest's formulas with the same results as Python."""

import random
from typing import Any

import numpy as np
import pytest

from mutator.triggers.conditions import canonical_condition, canonical_formula
from mutator.triggers.formula_json import formula_as_json
from mutator.triggers.trace_formulas import condition_at_each_step, formula_at_each_step
from mutator.web import asset_text

NAMES = ("t", "gap", "speed", "closing")
ODD = [0.0, -0.0, 1.0, -2.5, 1e-300, 1e300, np.inf, -np.inf, np.nan]
COUNT = 150  # formulas, and as many conditions


def term(rng: random.Random, depth: int = 3) -> str:
    if depth == 0:
        return rng.choice([*NAMES, "0", "1.5", "inf", "3e5"])
    a, b, c = (term(rng, depth - 1) for _ in range(3))
    made = [f"({a} {sign} {b})" for sign in "+-*/"]
    made += [f"(-{a})", f"abs({a})", f"rate({a})", f"min({a}, {b}, {c})", f"max({a}, {b})"]
    return rng.choice(made)


def condition(rng: random.Random) -> str:
    a, b, c = (term(rng, 1) for _ in range(3))
    one = f"{a} {rng.choice(['<', '<=', '>', '>=', '==', '!='])} {b}"
    return rng.choice([one, f"not {one} and {c} > 1", f"ever({one}) or {c} < 0", f"{a} <= {b} < {c}", "True"])


def formula(rng: random.Random) -> str:
    """Return a random formula. `hypot` is outermost, because its last digit differs between languages."""
    a, b = term(rng, 2), term(rng, 2)
    return rng.choice([term(rng), f"{a} if {condition(rng)} else {b}", f"hypot({a}, {b})"])


@pytest.fixture
def values() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    made = {name: rng.normal(0.0, 5.0, 40) for name in NAMES}
    for name in NAMES[1:]:
        made[name][rng.integers(0, 40, 12)] = rng.choice(ODD, 12)
    return made | {"t": np.arange(40) * 0.05}


def test_python_and_the_page_agree_on_formulas(browser: Any, values: dict[str, np.ndarray]) -> None:
    rng = random.Random(18)
    formulas = [canonical_formula(formula(rng), NAMES, over_time=True) for _ in range(COUNT)]
    conditions = [canonical_condition(condition(rng), variables=NAMES, over_time=True) for _ in range(COUNT)]
    page = browser.new_page()
    page.add_script_tag(content=asset_text("replay/formula.js") + "\nglobalThis.Formula = Formula;")
    given = {name: array.tolist() for name, array in values.items()}
    script = "([trees, values]) => trees.map((tree) => Formula.evaluate(tree, values))"
    found = page.evaluate(script, [[formula_as_json(text, {}) for text in (*formulas, *conditions)], given])
    page.close()
    for text, there in zip(formulas, found[:COUNT], strict=True):
        tolerance = 1e-12 if "hypot" in text else 0.0
        np.testing.assert_allclose(
            there, formula_at_each_step(text, values), rtol=tolerance, atol=0.0, err_msg=text
        )
    for text, there in zip(conditions, found[COUNT:], strict=True):
        assert there == condition_at_each_step(text, values).tolist(), text
