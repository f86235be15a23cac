"""Collects what each statement of a function assigns, calls and returns, and its lines."""

import ast
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import libcst as cst

from mutator.config.location_syntax import assignable
from mutator.mutants.name_scopes import FunctionNames, as_compiled
from mutator.mutants.node_positions import Place, Positions, function_place, line_after, statement_place


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """A small statement, or another construct that binds a name or calls a function.

    Lines are counted from 0, `last` is exclusive. Names are dotted, as written. A statement that returns also
    has the empty name in `returns`, which matches any return. Only small statements have a `place`.
    """

    first: int
    last: int
    place: Place | None = None
    assigns: tuple[str, ...] = ()
    calls: tuple[str, ...] = ()
    returns: tuple[str, ...] = ()
    first_in_line: bool = True
    last_in_line: bool = True
    one_line_suite: bool = False
    spanning_string: bool = False
    reason: str | None = None  # why nothing can be anchored at this construct
    opens: int | None = None  # for a binding in the head of a block: the block's first line

    def names(self, verb: str) -> tuple[str, ...]:
        return {"assign": self.assigns, "call": self.calls, "return": self.returns}[verb]

    @property
    def alone(self) -> bool:
        return self.first_in_line and self.last_in_line and not self.one_line_suite

    @property
    def is_return(self) -> bool:
        return bool(self.returns)


@dataclass(frozen=True, slots=True, kw_only=True)
class Function:
    """A function. Its statements do not include those of nested functions and classes.

    `entry` has the index of the line before which to insert, and of the line whose indentation to use; None
    if nothing can be inserted.
    """

    line: int
    place: Place
    statements: tuple[Statement, ...]
    names: frozenset[str]
    entry: tuple[int, int] | None


def collect(
    module: cst.Module, positions: Positions, names: FunctionNames
) -> dict[str, tuple[Function, ...]]:
    """Return all functions by qualified name (`Class.method`, `outer.inner`), in source order."""
    collector = _Collector(positions, names)
    module.visit(collector)
    return {name: tuple(functions) for name, functions in collector.functions.items()}


def dotted(node: cst.CSTNode | None) -> str | None:
    """Return `a.b.c` for a chain of names, None for anything else."""
    if isinstance(node, cst.Name):
        return as_compiled(node.value)
    if isinstance(node, cst.Attribute):
        base = dotted(node.value)
        return f"{base}.{as_compiled(node.attr.value)}" if base else None
    return None


def item(node: cst.Subscript) -> str | None:
    """Return `a['b']`, as anchors name it; None if it has a computed part, which could change."""
    text = ast.unparse(ast.parse(cst.Module([]).code_for_node(node), mode="eval"))
    return text if assignable(text) else None


class _Collector(cst.CSTVisitor):
    def __init__(self, positions: Positions, names: FunctionNames) -> None:
        super().__init__()
        self.positions = positions
        self.names = names
        self.functions: dict[str, list[Function]] = {}
        self.scope: list[str] = []
        self.open: list[list[Statement] | None] = []  # None for a class
        self.heads: set[int] = set()  # ids of targets in heads of blocks

    def visit_ClassDef(self, node: cst.ClassDef) -> None:  # noqa: N802
        self.scope.append(as_compiled(node.name.value))
        self.open.append(None)

    def leave_ClassDef(self, original_node: cst.ClassDef) -> None:  # noqa: N802
        self.scope.pop()
        self.open.pop()

    def visit_FunctionDef(self, node: cst.FunctionDef) -> None:  # noqa: N802
        self.scope.append(as_compiled(node.name.value))
        self.open.append([])

    def leave_FunctionDef(self, original_node: cst.FunctionDef) -> None:  # noqa: N802
        statements = self.open.pop()
        assert statements is not None
        line = self.positions[original_node].start.line
        function = Function(
            line=line - 1,
            place=function_place(original_node, self.positions),
            statements=tuple(sorted(statements, key=lambda s: s.first)),
            names=self.names.get((line, self.scope[-1]), frozenset()),
            entry=_entry(original_node, self.positions),
        )
        self.functions.setdefault(".".join(self.scope), []).append(function)
        self.scope.pop()

    def visit_SimpleStatementLine(self, node: cst.SimpleStatementLine) -> None:  # noqa: N802
        self._add(node, one_line_suite=False)

    def visit_SimpleStatementSuite(self, node: cst.SimpleStatementSuite) -> None:  # noqa: N802
        self._add(node, one_line_suite=True)

    def visit_For(self, node: cst.For) -> None:  # noqa: N802
        self._add_head(node.target, node.body, "it is the target of a `for`")

    def visit_With(self, node: cst.With) -> None:  # noqa: N802
        for item in node.items:
            if item.asname:
                self._add_head(item.asname.name, node.body, "it is bound by `as`")

    def visit_ExceptHandler(self, node: cst.ExceptHandler) -> None:  # noqa: N802
        if node.name:
            self._add_head(node.name.name, node.body, "it is bound by `as`")

    def visit_AsName(self, node: cst.AsName) -> None:  # noqa: N802
        if id(node.name) not in self.heads:
            self._add_other(node, _targets(node.name), "it is bound by `as`")

    def visit_NamedExpr(self, node: cst.NamedExpr) -> None:  # noqa: N802
        self._add_other(node, _targets(node.target), "it is bound by `:=` inside an expression")

    def _add(self, node: cst.SimpleStatementLine | cst.SimpleStatementSuite, one_line_suite: bool) -> None:
        statements = self.open[-1] if self.open else None
        if statements is None:
            return
        span = self.positions[node]
        last = line_after(node, self.positions)
        for i, small in enumerate(node.body):
            outer = _outer_call(small)
            for call in _inner_calls(small, outer):
                self._add_other(
                    call, [dotted(call.func) or ""], "the call is part of an expression", calls=True
                )
            assigns, calls, returns = _effects(small, outer)
            if not (assigns or calls or returns):
                continue
            statements.append(
                Statement(
                    first=span.start.line - 1,
                    last=last,
                    place=statement_place(small, self.positions),
                    assigns=assigns,
                    calls=calls,
                    returns=returns,
                    first_in_line=i == 0,
                    last_in_line=i == len(node.body) - 1,
                    one_line_suite=one_line_suite,
                    spanning_string=_spanning_string(small, self.positions),
                )
            )

    def _add_head(self, target: cst.CSTNode, body: cst.BaseSuite, reason: str) -> None:
        """Add what the head of a block binds. Snippets go into the block, if the block has its own lines."""
        self.heads.add(id(target))
        statements, names = self.open[-1] if self.open else None, _targets(target)
        if statements is None or not names:
            return
        if not isinstance(body, cst.IndentedBlock):
            self._add_other(target, names, reason)
            return
        first = body.body[0]
        decorators = first.decorators if isinstance(first, cst.FunctionDef | cst.ClassDef) else ()
        opens = min(self.positions[node].start.line for node in (first, *decorators)) - 1
        line = self.positions[target].start.line - 1
        statements.append(Statement(first=line, last=opens, assigns=tuple(_that_stay(names)), opens=opens))

    def _add_other(self, node: cst.CSTNode, names: list[str], reason: str, calls: bool = False) -> None:
        statements = self.open[-1] if self.open else None
        if statements is not None and names and all(names):
            span = self.positions[node]
            bound_names = tuple(names)
            statements.append(
                Statement(
                    first=span.start.line - 1,
                    last=span.end.line,
                    assigns=() if calls else bound_names,
                    calls=bound_names if calls else (),
                    reason=reason,
                )
            )


def _value(small: cst.BaseSmallStatement) -> cst.BaseExpression | None:
    if isinstance(small, cst.Expr | cst.Assign | cst.AugAssign | cst.AnnAssign | cst.Return):
        return small.value
    return None


def _outer_call(small: cst.BaseSmallStatement) -> cst.Call | None:
    value = _value(small)
    if isinstance(value, cst.Await):
        value = value.expression
    return value if isinstance(value, cst.Call) else None


def _effects(
    small: cst.BaseSmallStatement, call: cst.Call | None
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    assigns: list[str] = []
    if isinstance(small, cst.Assign):
        assigns = [name for target in small.targets for name in _targets(target.target)]
    elif isinstance(small, cst.AugAssign) or (isinstance(small, cst.AnnAssign) and small.value is not None):
        assigns = _targets(small.target)
    called = dotted(call.func) if call else None
    returns: list[str] = []
    if isinstance(small, cst.Return):
        returned = called or dotted(small.value)
        returns = ["", returned] if returned else [""]
    unique = tuple(_that_stay(assigns))
    return unique, (called,) if called else (), tuple(returns)


def _that_stay(names: Sequence[str]) -> Iterator[str]:
    """Yield the assigned names without duplicates, and without items whose index is assigned later.

    After `a[i], i = 1, 2`, `a[i]` names a different item.
    """
    unique = list(dict.fromkeys(names))
    for place, name in enumerate(unique, 1):
        parts = ast.walk(ast.parse(name, mode="eval")) if "[" in name else ()
        within = {ast.unparse(part) for part in parts if isinstance(part, ast.expr)}
        if within.isdisjoint(unique[place:]):
            yield name


def _targets(node: cst.CSTNode) -> list[str]:
    if isinstance(node, cst.Tuple | cst.List):
        return [name for element in node.elements for name in _targets(element.value)]
    if isinstance(node, cst.StarredElement):
        return _targets(node.value)
    name = item(node) if isinstance(node, cst.Subscript) else dotted(node)
    return [name] if name else []


def _inner_calls(small: cst.BaseSmallStatement, outer: cst.Call | None) -> Iterator[cst.Call]:
    stack: list[cst.CSTNode] = [small]
    while stack:
        node = stack.pop()
        if isinstance(node, cst.Call) and node is not outer:
            yield node
        stack += node.children


def _spanning_string(small: cst.BaseSmallStatement, positions: Positions) -> bool:
    """Return whether a string literal spans several lines, which must then not be indented."""
    stack: list[cst.CSTNode] = [small]
    while stack:
        node = stack.pop()
        if isinstance(node, cst.SimpleString | cst.FormattedString):
            span = positions[node]
            if span.start.line != span.end.line:
                return True
        stack += node.children
    return False


def _entry(node: cst.FunctionDef, positions: Positions) -> tuple[int, int] | None:
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
    return line_after(first, positions), positions[first].start.line - 1
