"""Filter expressions over table columns (`--only`, `--exclude`): parsed, never evaluated as code.

fault_type == "shifted" and scenario in ("S1", "S2") and value > 100
match(fault_type, "ghost*") and not method == "random"
"""

import ast
import operator
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from fnmatch import fnmatchcase
from typing import TypeVar

from mutator._common.message_text import python_operator_hint, spelling_suggestion
from mutator.errors import MutatorError, MutatorWarning
from mutator.results.renamed_columns import RENAMED_COLUMNS

FilterRow = Mapping[str, object]
RowPredicate = Callable[[FilterRow], bool]
CellGetter = Callable[[FilterRow], object]
Item = TypeVar("Item")

_ORDER_OPERATORS: dict[type[ast.cmpop], Callable[[object, object], bool]] = {
    ast.Lt: operator.lt,  # type: ignore[dict-item]
    ast.LtE: operator.le,  # type: ignore[dict-item]
    ast.Gt: operator.gt,  # type: ignore[dict-item]
    ast.GtE: operator.ge,  # type: ignore[dict-item]
}
_MOST_CHARACTERS = 2000  # more than anybody writes; limits how deep an expression can nest
_MOST_LISTED_VALUES = 25  # a column with more, such as an id, is not searched for similar values
_ALLOWED_SYNTAX = (
    'columns, numbers, "strings", ==, !=, <, <=, >, >=, in, not in, and, or, not, match(column, "glob*")'
)


def matching_items(
    items: Iterable[Item],
    text: str,
    columns: Collection[str],
    row_of: Callable[[Item], FilterRow],
    *,
    keeps_matches: bool = True,
) -> Iterator[Item]:
    """Yield the items whose rows match a filter; without `keeps_matches`, the others.

    MutatorError as for `compile_filter`; MutatorWarning for a text that is compared with a column of few
    values and is none of them, because it is probably misspelt; it comes after the last item.
    """
    accepts = compile_filter(text, columns)
    compared_texts = list(_compared_texts(ast.parse(text.strip(), mode="eval")))
    values_by_column: dict[str, set[object]] = {column: set() for column, _ in compared_texts}
    for item in items:
        row = row_of(item)
        for column, values in values_by_column.items():
            if len(values) <= _MOST_LISTED_VALUES:
                values.add(row[column])
        if accepts(row) is keeps_matches:
            yield item
    for column, compared_text in compared_texts:
        _warn_if_unknown(column, compared_text, values_by_column[column])


def _compared_texts(tree: ast.AST) -> Iterator[tuple[str, str]]:
    """Yield each column with a text that it is compared with for equality."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Compare) or len(node.ops) != 1:
            continue
        left, right = node.left, node.comparators[0]
        if isinstance(node.ops[0], ast.Eq | ast.NotEq) and isinstance(right, ast.Name):
            left, right = right, left
        elif not isinstance(node.ops[0], ast.Eq | ast.NotEq | ast.In | ast.NotIn):
            continue
        constants = right.elts if isinstance(right, ast.Tuple | ast.List | ast.Set) else [right]
        for constant in constants:
            is_text = isinstance(constant, ast.Constant) and isinstance(constant.value, str)
            if isinstance(left, ast.Name) and is_text:
                yield left.id, constant.value  # type: ignore[attr-defined]


def _warn_if_unknown(column: str, text: str, values: set[object]) -> None:
    texts = sorted(value for value in values if isinstance(value, str) and value)
    if not texts or text in values or not text or len(values) > _MOST_LISTED_VALUES:
        return
    suggestion = spelling_suggestion(text, texts) or "."
    warnings.warn(
        f"`{column}` is never '{text}' here{suggestion} Its values: {', '.join(texts)}",
        MutatorWarning,
        stacklevel=3,
    )


def compile_filter(text: str, columns: Collection[str]) -> RowPredicate:
    """Compile a filter into a predicate over rows.

    An empty cell equals only `None`, and is neither less nor greater than any value. MutatorError shows the
    text, the mistake and the known columns.
    """
    if len(text) > _MOST_CHARACTERS:
        raise _filter_error(text[:60] + "...", f"{len(text)} characters", f"at most {_MOST_CHARACTERS}")
    try:
        tree = ast.parse(text.strip(), mode="eval")
        return _FilterCompiler(text, columns).node_predicate(tree.body)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as err:
        got = f"not an expression ({getattr(err, 'msg', err)})"
        raise _filter_error(text, got, _ALLOWED_SYNTAX, python_operator_hint(text)) from None


def _filter_error(text: str, got: str, expected: str, remedy: str = "") -> MutatorError:
    return MutatorError(f"{got} in the filter `{text}`", expected=expected, remedy=remedy or None)


class _FilterCompiler:
    def __init__(self, text: str, columns: Collection[str]) -> None:
        self.text = text
        self.columns = columns

    def node_predicate(self, node: ast.expr) -> RowPredicate:
        if isinstance(node, ast.BoolOp):
            parts = [self.node_predicate(v) for v in node.values]
            if isinstance(node.op, ast.And):
                return lambda row: all(part(row) for part in parts)
            return lambda row: any(part(row) for part in parts)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            inner = self.node_predicate(node.operand)
            return lambda row: not inner(row)
        if isinstance(node, ast.Compare):
            return self.comparison_predicate(node)
        if isinstance(node, ast.Call):
            return self.match_predicate(node)
        if isinstance(node, ast.Name):
            get = self.cell_getter(node)
            return lambda row: bool(get(row))
        raise self.refusal(node)

    def comparison_predicate(self, node: ast.Compare) -> RowPredicate:
        operands = [self.cell_getter(side) for side in (node.left, *node.comparators)]
        links = [self.comparator(op) for op in node.ops]

        def holds(row: FilterRow) -> bool:
            values = [get(row) for get in operands]
            return all(link(values[i], values[i + 1]) for i, link in enumerate(links))

        return holds

    def comparator(self, op: ast.cmpop) -> Callable[[object, object], bool]:
        if isinstance(op, ast.Eq):
            return operator.eq
        if isinstance(op, ast.NotEq):
            return operator.ne
        if isinstance(op, ast.In):
            return lambda a, b: self.contains(b, a)
        if isinstance(op, ast.NotIn):
            return lambda a, b: not self.contains(b, a)
        if type(op) in _ORDER_OPERATORS:
            return lambda a, b: self.compare_in_order(type(op), a, b)
        raise _filter_error(self.text, "`is`", "== or !=")

    def contains(self, group: object, value: object) -> bool:
        if not isinstance(group, tuple | str) or (isinstance(group, str) and not isinstance(value, str)):
            raise _filter_error(
                self.text, f"{group!r} on the right of `in`", "a tuple, or text if the left side is text"
            )
        return value in group

    def compare_in_order(self, op: type[ast.cmpop], a: object, b: object) -> bool:
        if a is None or b is None:
            return False
        try:
            return _ORDER_OPERATORS[op](a, b)
        except TypeError:
            raise _filter_error(
                self.text, f"{a!r} compared with {b!r}", "numbers with numbers, texts with texts"
            ) from None

    def match_predicate(self, node: ast.Call) -> RowPredicate:
        if not (isinstance(node.func, ast.Name) and node.func.id == "match" and len(node.args) == 2):
            raise self.refusal(node)
        pattern = node.args[1]
        if node.keywords or not (isinstance(pattern, ast.Constant) and isinstance(pattern.value, str)):
            raise self.refusal(node)
        get, glob = self.cell_getter(node.args[0]), pattern.value

        def matches(row: FilterRow) -> bool:
            value = get(row)
            return value is not None and fnmatchcase(str(value), glob)

        return matches

    def cell_getter(self, node: ast.expr) -> CellGetter:
        if isinstance(node, ast.Name):
            name = node.id
            if name not in self.columns:
                new_name = RENAMED_COLUMNS.get(name)
                remedy = (
                    f"write `{new_name}`, the name of this column now"
                    if new_name in self.columns
                    else "correct the name" + spelling_suggestion(name, list(self.columns))
                )
                raise _filter_error(
                    self.text, f"unknown column `{name}`", "one of " + ", ".join(self.columns), remedy
                )
            return lambda row: row[name]
        constant = self.constant_value(node)
        return lambda row: constant

    def constant_value(self, node: ast.expr) -> object:
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float | str | bool | None):
            return node.value
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            value = self.constant_value(node.operand)
            if isinstance(value, int | float):
                return -value
        if isinstance(node, ast.Tuple | ast.List | ast.Set):
            return tuple(self.constant_value(item) for item in node.elts)
        raise self.refusal(node)

    def refusal(self, node: ast.expr) -> MutatorError:
        return _filter_error(self.text, f"`{ast.unparse(node)}`", _ALLOWED_SYNTAX)
