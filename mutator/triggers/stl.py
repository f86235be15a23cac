"""Signal temporal logic, as rtamt reads it: an extra (`pip install rtamt`)."""

import re
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from mutator.errors import MutatorError

_NAME = re.compile(r"\b[A-Za-z_]\w*\b")
_OUT = "robustness_of_it"


def check(formula: str, variables: Collection[str]) -> None:
    """MutatorError for a formula that rtamt cannot read, and where rtamt is not installed."""
    _parsed(formula, variables, step_s=1.0)


def names_in(formula: str, variables: Collection[str]) -> tuple[str, ...]:
    """The variables that a formula asks for."""
    known = set(variables)
    return tuple(dict.fromkeys(name for name in _NAME.findall(formula) if name in known))


def robustness(formula: str, values: Mapping[str, np.ndarray], step_s: float) -> np.ndarray:
    """How far the trace up to each step is from violating the formula (below 0: it does).

    `values` has an array for each variable, sampled in steps of `step_s`. A formula that looks ahead is
    judged when it has seen all that it looks at.
    """
    names = names_in(formula, values)
    specification = _parsed(formula, names, step_s)
    rows = zip(*(values[name].tolist() for name in names), strict=True)
    return np.array(
        [specification.update(i, list(zip(names, row, strict=True))) for i, row in enumerate(rows)]
    )


def _parsed(formula: str, variables: Collection[str], step_s: float) -> Any:
    try:
        import rtamt  # type: ignore[import-untyped]
    except ImportError:
        raise MutatorError(
            "a formula of signal temporal logic, and no rtamt to read it",
            expected="the package rtamt",
            remedy="pip install rtamt, or say it with `when`",
        ) from None
    specification = rtamt.StlDiscreteTimeSpecification()
    for name in (*names_in(formula, variables), _OUT):
        specification.declare_var(name, "float")
    specification.set_sampling_period(round(step_s * 1e6), "us", 0.1)
    specification.spec = f"{_OUT} = {formula}"
    try:
        specification.parse()
        specification.pastify()
    except KeyError as error:
        raise _refuse(f"unknown name {error}", formula, variables) from None
    except rtamt.RTAMTException as error:
        raise _refuse(str(error).removeprefix("RTAMT Exception: ").strip(), formula, variables) from None
    return specification


def _refuse(what: str, formula: str, variables: Collection[str]) -> MutatorError:
    return MutatorError(
        f"{what} in {formula!r}",
        expected="a formula of signal temporal logic that looks back, or ahead for a given time, over "
        + ", ".join(variables),
        remedy="rewrite it: `historically(x < 3)` instead of `always(x < 3)`",
    )
