"""Prove that the conditions of a context table cover every situation exactly once.

The constants in the conditions divide each variable's axis into points and open intervals. Conditions are
constant within such a cell, so a test of one value per cell is a proof. Variables are treated as independent:
a table that is complete only because one variable depends on another fails.
"""

import ast
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise, product

from mutator._common.message_text import counted
from mutator.errors import BoundaryNotTestable
from mutator.triggers.conditions import evaluate_condition

MOST_CELL_TESTS = 400_000  # most tests: contexts times cells


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisCell:
    """A part of a variable's axis: `value` lies in it, and `text` describes it (`gap > 2.0`)."""

    value: float
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TableCoverage:
    """The number of tested cells, and the first place that the contexts do not cover exactly once.

    `no_proof_reason` says why no proof was possible; `overlapping_rows` are the contexts that hold at
    `first_gap_or_overlap`, or none.
    """

    cell_count: int = 0
    no_proof_reason: str | None = None
    first_gap_or_overlap: str | None = None
    overlapping_rows: tuple[str, ...] = ()


def measure_coverage(conditions: Mapping[str, str]) -> TableCoverage:
    """Test the conditions of a table, row id -> condition, in every cell."""
    try:
        cuts = _constants_by_variable(conditions.values())
    except BoundaryNotTestable as error:
        return TableCoverage(
            no_proof_reason=f"{error}; only comparisons of one variable with a constant can be tested"
        )
    axes = [_axis_cells(name, sorted(values)) for name, values in cuts.items()]
    total = math.prod(len(axis) for axis in axes)
    if total * len(conditions) > MOST_CELL_TESTS:
        size = f"{counted(total, 'cell')} for {counted(len(conditions), 'context')}"
        return TableCoverage(no_proof_reason=f"its constants yield {size}, too many to test")
    for place in product(*axes):
        values = {name: cell.value for name, cell in zip(cuts, place, strict=True)}
        rows = tuple(row for row, condition in conditions.items() if evaluate_condition(condition, values))
        if len(rows) != 1:
            text = " and ".join(cell.text for cell in place) or "any observation"
            return TableCoverage(cell_count=total, first_gap_or_overlap=text, overlapping_rows=rows)
    return TableCoverage(cell_count=total)


def _constants_by_variable(conditions: Iterable[str]) -> dict[str, set[float]]:
    cuts: dict[str, set[float]] = {}
    for condition in conditions:
        for node in ast.walk(ast.parse(condition, mode="eval")):
            if isinstance(node, ast.Compare):
                for left, right in pairwise((node.left, *node.comparators)):
                    name, value = _variable_and_constant(left, right)
                    cuts.setdefault(name, set()).add(value)
    return cuts


def _variable_and_constant(left: ast.expr, right: ast.expr) -> tuple[str, float]:
    for variable, constant in ((left, right), (right, left)):
        value = _constant_value(constant)
        if isinstance(variable, ast.Name) and value is not None:
            return variable.id, value
    raise BoundaryNotTestable(f"a condition compares '{ast.unparse(left)}' with '{ast.unparse(right)}'")


def _constant_value(node: ast.expr) -> float | None:
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        value = _constant_value(node.operand)
        return None if value is None else -value
    return float(node.value) if isinstance(node, ast.Constant) and isinstance(node.value, float) else None


def _axis_cells(name: str, cuts: list[float]) -> list[AxisCell]:
    cells = [AxisCell(value=-math.inf, text=f"{name} < {cuts[0]}")]
    for low, high in pairwise(cuts):
        cells.append(AxisCell(value=low, text=f"{name} = {low}"))
        middle = low + (high - low) / 2.0
        if low < middle < high:  # otherwise no number lies between them
            cells.append(AxisCell(value=middle, text=f"{low} < {name} < {high}"))
    cells.append(AxisCell(value=cuts[-1], text=f"{name} = {cuts[-1]}"))
    return [*cells, AxisCell(value=math.inf, text=f"{name} > {cuts[-1]}")]
