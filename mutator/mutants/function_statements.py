"""Collects what each statement of a function assigns, calls and returns, and its lines."""

import ast
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import libcst as cst

from mutator.config.location_syntax import is_assignable
from mutator.mutants.name_scopes import UsedNamesByFunction, normalize_identifier
from mutator.mutants.positions_of_both_parsers import (
    NodePosition,
    RangeByNode,
    function_position,
    line_after_statements,
    statement_position,
)

_ANCHOR_VERBS = ("assign", "call", "return")


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """A small statement, or another construct that binds a name or calls a function.

    Lines are counted from 0, `end_line` is exclusive. Names are dotted, as written. A statement that returns
    also has the empty name in `returned_names`, which matches any return. Only small statements have a
    `position`.
    """

    first_line: int
    end_line: int
    position: NodePosition | None = None
    assigned_names: tuple[str, ...] = ()
    called_names: tuple[str, ...] = ()
    returned_names: tuple[str, ...] = ()
    is_first_in_line: bool = True
    is_last_in_line: bool = True
    is_in_one_line_suite: bool = False
    has_multiline_string: bool = False
    unanchorable_reason: str | None = None  # why nothing can be anchored at this construct
    # for names that the head of an indented block binds: the first line of the block
    block_start_of_head_binding: int | None = None

    def names_for(self, verb: str) -> tuple[str, ...]:
        return {"assign": self.assigned_names, "call": self.called_names, "return": self.returned_names}[verb]

    @property
    def is_alone(self) -> bool:
        return self.is_first_in_line and self.is_last_in_line and not self.is_in_one_line_suite

    @property
    def is_return(self) -> bool:
        return bool(self.returned_names)


@dataclass(frozen=True, kw_only=True)
class Function:
    """A function. Its statements do not include those of nested functions and classes.

    `entry_and_indent_lines` has the index of the line before which to insert, and of the line whose
    indentation to use; None if nothing can be inserted.
    """

    def_line: int
    position: NodePosition
    statements: tuple[Statement, ...]
    used_names: frozenset[str]
    entry_and_indent_lines: tuple[int, int] | None

    @cached_property
    def statements_by_name(self) -> Mapping[tuple[str, str], Sequence[Statement]]:
        """The statements by verb ("assign", "call" or "return") and name, in source order."""
        statements: dict[tuple[str, str], list[Statement]] = defaultdict(list)
        for statement in self.statements:
            for verb in _ANCHOR_VERBS:
                for name in dict.fromkeys(statement.names_for(verb)):
                    statements[verb, name].append(statement)
        return statements


def collect_functions(
    module: cst.Module, positions: RangeByNode, names: UsedNamesByFunction
) -> dict[str, tuple[Function, ...]]:
    """Return all functions by qualified name (`Class.method`, `outer.inner`), in source order."""
    collector = _FunctionCollector(positions, names)
    module.visit(collector)
    return {name: tuple(functions) for name, functions in collector.functions.items()}


def dotted_name_of(node: cst.CSTNode | None) -> str | None:
    """Return `a.b.c` for a chain of names, None for anything else."""
    if isinstance(node, cst.Name):
        return normalize_identifier(node.value)
    if isinstance(node, cst.Attribute):
        base = dotted_name_of(node.value)
        return f"{base}.{normalize_identifier(node.attr.value)}" if base else None
    return None


def item_name_of(node: cst.Subscript) -> str | None:
    """Return `a['b']`, as anchors name it; None if it has a computed part, which could change."""
    text = ast.unparse(ast.parse(cst.Module([]).code_for_node(node), mode="eval"))
    return text if is_assignable(text) else None


class _FunctionCollector(cst.CSTVisitor):
    def __init__(self, positions: RangeByNode, names: UsedNamesByFunction) -> None:
        super().__init__()
        self.positions = positions
        self.names_by_function = names
        self.functions: dict[str, list[Function]] = {}
        self.scope_names: list[str] = []
        self.open_scopes: list[list[Statement] | None] = []  # None for a class
        self.head_target_ids: set[int] = set()  # ids of targets in heads of blocks

    def visit_ClassDef(self, node: cst.ClassDef) -> None:  # noqa: N802
        self.scope_names.append(normalize_identifier(node.name.value))
        self.open_scopes.append(None)

    def leave_ClassDef(self, original_node: cst.ClassDef) -> None:  # noqa: N802
        self.scope_names.pop()
        self.open_scopes.pop()

    def visit_FunctionDef(self, node: cst.FunctionDef) -> None:  # noqa: N802
        self.scope_names.append(normalize_identifier(node.name.value))
        self.open_scopes.append([])

    def leave_FunctionDef(self, original_node: cst.FunctionDef) -> None:  # noqa: N802
        statements = self.open_scopes.pop()
        assert statements is not None
        line = self.positions[original_node].start.line
        function = Function(
            def_line=line - 1,
            position=function_position(original_node, self.positions),
            statements=tuple(sorted(statements, key=lambda s: s.first_line)),
            used_names=self.names_by_function.get((line, self.scope_names[-1]), frozenset()),
            entry_and_indent_lines=_entry_and_indent_lines(original_node, self.positions),
        )
        self.functions.setdefault(".".join(self.scope_names), []).append(function)
        self.scope_names.pop()

    def visit_SimpleStatementLine(self, node: cst.SimpleStatementLine) -> None:  # noqa: N802
        self._add_small_statements(node, one_line_suite=False)

    def visit_SimpleStatementSuite(self, node: cst.SimpleStatementSuite) -> None:  # noqa: N802
        self._add_small_statements(node, one_line_suite=True)

    def visit_For(self, node: cst.For) -> None:  # noqa: N802
        self._add_head_binding(node.target, node.body, "it is the target of a `for`")

    def visit_With(self, node: cst.With) -> None:  # noqa: N802
        for item in node.items:
            if item.asname:
                self._add_head_binding(item.asname.name, node.body, "it is bound by `as`")

    def visit_ExceptHandler(self, node: cst.ExceptHandler) -> None:  # noqa: N802
        if node.name:
            self._add_head_binding(node.name.name, node.body, "it is bound by `as`")

    def visit_AsName(self, node: cst.AsName) -> None:  # noqa: N802
        if id(node.name) not in self.head_target_ids:
            self._add_unanchorable(node, _target_names(node.name), "it is bound by `as`")

    def visit_NamedExpr(self, node: cst.NamedExpr) -> None:  # noqa: N802
        self._add_unanchorable(node, _target_names(node.target), "it is bound by `:=` inside an expression")

    def _add_small_statements(
        self, node: cst.SimpleStatementLine | cst.SimpleStatementSuite, one_line_suite: bool
    ) -> None:
        statements = self.open_scopes[-1] if self.open_scopes else None
        if statements is None:
            return
        span = self.positions[node]
        last = line_after_statements(node, self.positions)
        for i, small in enumerate(node.body):
            outer = _call_as_whole_value(small)
            for call in _other_calls(small, outer):
                self._add_unanchorable(
                    call, [dotted_name_of(call.func) or ""], "the call is part of an expression", calls=True
                )
            assigns, calls, returns = _assigned_called_and_returned(small, outer)
            if not (assigns or calls or returns):
                continue
            statements.append(
                Statement(
                    first_line=span.start.line - 1,
                    end_line=last,
                    position=statement_position(small, self.positions),
                    assigned_names=assigns,
                    called_names=calls,
                    returned_names=returns,
                    is_first_in_line=i == 0,
                    is_last_in_line=i == len(node.body) - 1,
                    is_in_one_line_suite=one_line_suite,
                    has_multiline_string=_has_multiline_string(small, self.positions),
                )
            )

    def _add_head_binding(self, target: cst.CSTNode, body: cst.BaseSuite, reason: str) -> None:
        """Add what the head of a block binds. Snippets go into the block, if the block has its own lines."""
        self.head_target_ids.add(id(target))
        statements, names = self.open_scopes[-1] if self.open_scopes else None, _target_names(target)
        if statements is None or not names:
            return
        if not isinstance(body, cst.IndentedBlock):
            self._add_unanchorable(target, names, reason)
            return
        first = body.body[0]
        decorators = first.decorators if isinstance(first, cst.FunctionDef | cst.ClassDef) else ()
        opens = min(self.positions[node].start.line for node in (first, *decorators)) - 1
        line = self.positions[target].start.line - 1
        statements.append(
            Statement(
                first_line=line,
                end_line=opens,
                assigned_names=tuple(_unique_stable_names(names)),
                block_start_of_head_binding=opens,
            )
        )

    def _add_unanchorable(
        self, node: cst.CSTNode, names: list[str], reason: str, calls: bool = False
    ) -> None:
        statements = self.open_scopes[-1] if self.open_scopes else None
        if statements is not None and names and all(names):
            span = self.positions[node]
            bound_names = tuple(names)
            statements.append(
                Statement(
                    first_line=span.start.line - 1,
                    end_line=span.end.line,
                    assigned_names=() if calls else bound_names,
                    called_names=bound_names if calls else (),
                    unanchorable_reason=reason,
                )
            )


def _value_of(small: cst.BaseSmallStatement) -> cst.BaseExpression | None:
    if isinstance(small, cst.Expr | cst.Assign | cst.AugAssign | cst.AnnAssign | cst.Return):
        return small.value
    return None


def _call_as_whole_value(small: cst.BaseSmallStatement) -> cst.Call | None:
    value = _value_of(small)
    if isinstance(value, cst.Await):
        value = value.expression
    return value if isinstance(value, cst.Call) else None


def _assigned_called_and_returned(
    small: cst.BaseSmallStatement, call: cst.Call | None
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    assigns: list[str] = []
    if isinstance(small, cst.Assign):
        assigns = [name for target in small.targets for name in _target_names(target.target)]
    elif isinstance(small, cst.AugAssign) or (isinstance(small, cst.AnnAssign) and small.value is not None):
        assigns = _target_names(small.target)
    called = dotted_name_of(call.func) if call else None
    returns: list[str] = []
    if isinstance(small, cst.Return):
        returned = called or dotted_name_of(small.value)
        returns = ["", returned] if returned else [""]
    unique = tuple(_unique_stable_names(assigns))
    return unique, (called,) if called else (), tuple(returns)


def _unique_stable_names(names: Sequence[str]) -> Iterator[str]:
    """Yield the assigned names without duplicates, and without items whose index is assigned later.

    After `a[i], i = 1, 2`, `a[i]` names a different item.
    """
    unique = list(dict.fromkeys(names))
    for number, name in enumerate(unique, 1):
        parts = ast.walk(ast.parse(name, mode="eval")) if "[" in name else ()
        within = {ast.unparse(part) for part in parts if isinstance(part, ast.expr)}
        if within.isdisjoint(unique[number:]):
            yield name


def _target_names(node: cst.CSTNode) -> list[str]:
    if isinstance(node, cst.Tuple | cst.List):
        return [name for element in node.elements for name in _target_names(element.value)]
    if isinstance(node, cst.StarredElement):
        return _target_names(node.value)
    name = item_name_of(node) if isinstance(node, cst.Subscript) else dotted_name_of(node)
    return [name] if name else []


def _other_calls(small: cst.BaseSmallStatement, outer: cst.Call | None) -> Iterator[cst.Call]:
    stack: list[cst.CSTNode] = [small]
    while stack:
        node = stack.pop()
        if isinstance(node, cst.Call) and node is not outer:
            yield node
        stack += node.children


def _has_multiline_string(small: cst.BaseSmallStatement, positions: RangeByNode) -> bool:
    """Return whether a string literal spans several lines, which must then not be indented."""
    stack: list[cst.CSTNode] = [small]
    while stack:
        node = stack.pop()
        if isinstance(node, cst.SimpleString | cst.FormattedString | cst.TemplatedString):
            span = positions[node]
            if span.start.line != span.end.line:
                return True
        stack += node.children
    return False


def _entry_and_indent_lines(node: cst.FunctionDef, positions: RangeByNode) -> tuple[int, int] | None:
    body = node.body
    if not isinstance(body, cst.IndentedBlock):
        return None
    first = body.body[0]
    if node.get_docstring(clean=False) is None:
        decorators = first.decorators if isinstance(first, cst.FunctionDef | cst.ClassDef) else ()
        line = min(positions[n].start.line for n in (first, *decorators)) - 1
        return line, line
    if not isinstance(first, cst.SimpleStatementLine) or len(first.body) > 1:
        return None
    return line_after_statements(first, positions), positions[first].start.line - 1
