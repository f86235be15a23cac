"""Expressions whose value can be changed where they stand: what a function returns, asks, passes on.

Python's own parser finds them, and what each is for; one counts only if LibCST sees an expression in the
same place. None begins or ends on a line that cannot carry a tag: one that ends inside a string, or in a
backslash.
"""

import ast
import io
import tokenize
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import libcst as cst

from mutator.model import AnchorKind
from mutator.mutants.places import Positions

_Point = tuple[int, int]  # line and column in bytes, both from 0
_Role = tuple[AnchorKind, str, str | None]
_Found = tuple[str, ast.expr, tuple[_Role, ...]]

_ATOMS = ast.Name | ast.Attribute | ast.Call | ast.Subscript | ast.Constant | ast.List | ast.Dict | ast.Set
_NOT_ALONE = ast.Starred | ast.Slice | ast.GeneratorExp | ast.Yield | ast.YieldFrom | ast.NamedExpr
_BLOCKS = ("body", "orelse", "finalbody")


@dataclass(frozen=True, slots=True, kw_only=True)
class Expression:
    """An expression of a function, from `start` to before `end`.

    `roles` are the anchors that it answers to: kind, name, which argument; the last is VALUE, with its text.
    `written` is its source on one line, in parentheses if an operator beside it could tear it apart.
    """

    function: str
    start: _Point
    end: _Point
    roles: tuple[_Role, ...]
    written: str
    bare: bool  # a tuple without parentheses
    node: ast.expr

    @property
    def text(self) -> str:
        """What an anchor calls it, however it is spaced and quoted in the source."""
        return self.roles[-1][1]

    def answers(self, kind: AnchorKind, name: str, which: str | None) -> bool:
        """Whether an anchor of this kind names it: an empty name or no `which` stands for any."""
        return any(
            kind is own and name in (called, "") and which in (place, None)
            for own, called, place in self.roles
        )


def _grouped(found: Iterable[Expression]) -> dict[str, tuple[Expression, ...]]:
    """Expressions by their function."""
    functions: dict[str, list[Expression]] = defaultdict(list)
    for one in found:
        functions[one.function].append(one)
    return {name: tuple(own) for name, own in functions.items()}


def expressions_of(
    data: bytes, module: cst.Module, positions: Positions
) -> dict[str, tuple[Expression, ...]]:
    """The expressions of each function of a file whose value can be changed, in the order of the source."""
    encoding = module.encoding.removesuffix("-sig")
    lines = [line.decode(encoding) for line in data.splitlines(keepends=True)]
    tokens = list(tokenize.tokenize(io.BytesIO(data).readline))
    seen, untaggable, brackets = _seen_by_libcst(positions), _untaggable(data, tokens), _brackets(tokens)
    found = []
    for function, node, roles in _in_functions(ast.parse(data)):
        start, end = _extent(lines, node)
        text, known = _text(node), all(_extent(lines, one) in seen for one in _known_by(node))
        if text and known and untaggable.isdisjoint((start[0], end[0])):
            bare = isinstance(node, ast.Tuple) and brackets.get(start) != end
            roles = (*roles, (AnchorKind.VALUE, text, None))
            found.append(_expression(lines, encoding, (function, node, roles), start, end, bare=bare))
    return _grouped(sorted(found, key=lambda one: (one.start, (-one.end[0], -one.end[1]))))


def _expression(
    lines: Sequence[str], encoding: str, found: _Found, start: _Point, end: _Point, *, bare: bool
) -> Expression:
    function, node, roles = found
    one_line = start[0] == end[0]
    written = lines[start[0]][start[1] : end[1]] if one_line else roles[-1][1]
    alone = isinstance(node, _ATOMS) or (isinstance(node, ast.Tuple) and not (bare and one_line))
    return Expression(
        function=function,
        start=(start[0], len(lines[start[0]][: start[1]].encode(encoding))),
        end=(end[0], len(lines[end[0]][: end[1]].encode(encoding))),
        roles=roles,
        written=written if alone else f"({written})",
        bare=bare,
        node=node,
    )


def _text(node: ast.AST) -> str:
    """Its source; empty where `ast` cannot write it: an int of thousands of digits, an f-string that would
    need a backslash inside braces."""
    try:
        return ast.unparse(node)
    except ValueError:
        return ""


def _extent(lines: Sequence[str], node: ast.expr) -> tuple[_Point, _Point]:
    """Where a node begins and ends: line and column in characters, from 0. `ast` counts bytes of UTF-8."""
    assert node.end_lineno is not None and node.end_col_offset is not None

    def point(line: int, column: int) -> _Point:
        text = lines[line - 1]
        return line - 1, column if text.isascii() else len(text.encode()[:column].decode())

    return point(node.lineno, node.col_offset), point(node.end_lineno, node.end_col_offset)


def _known_by(node: ast.expr) -> Iterator[ast.expr]:
    """The nodes by whose places LibCST must know it: a tuple, to which LibCST counts no parentheses, by its
    elements."""
    if isinstance(node, ast.Tuple):
        for element in node.elts:
            yield from _known_by(element)
    else:
        yield node


def _seen_by_libcst(positions: Positions) -> frozenset[tuple[_Point, _Point]]:
    return frozenset(
        ((span.start.line - 1, span.start.column), (span.end.line - 1, span.end.column))
        for node, span in positions.items()
        if isinstance(node, cst.BaseExpression)
    )


def _brackets(tokens: Iterable[tokenize.TokenInfo]) -> dict[_Point, _Point]:
    """Where each bracket that opens stands, and the end of the one that closes it: lines from 0."""
    found, begun = {}, list[_Point]()
    for token in tokens:
        if token.type == tokenize.OP and token.string in "([{":
            begun.append((token.start[0] - 1, token.start[1]))
        elif token.type == tokenize.OP and token.string in ")]}":
            found[begun.pop()] = (token.end[0] - 1, token.end[1])
    return found


def _untaggable(data: bytes, tokens: Iterable[tokenize.TokenInfo]) -> frozenset[int]:
    """The lines (from 0) that cannot end in a comment."""
    found = {i for i, line in enumerate(data.splitlines()) if line.endswith(b"\\")}
    begun: list[int] = []  # lines in which f-strings began that have not ended
    for token in tokens:
        kind = tokenize.tok_name[token.type]
        if kind == "FSTRING_START":
            begun.append(token.start[0])
        first = begun.pop() if kind == "FSTRING_END" else token.start[0]
        if kind in ("STRING", "FSTRING_END"):
            found.update(range(first - 1, token.end[0] - 1))
    return frozenset(found)


def _in_functions(tree: ast.Module) -> Iterator[_Found]:
    """Each expression in a function's body, with the function's qualified name and what it is there."""
    yield from _of_scope(tree.body, (), inside=False)


def _of_scope(body: Iterable[ast.stmt], scope: tuple[str, ...], *, inside: bool) -> Iterator[_Found]:
    for statement in body:
        if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            in_function = not isinstance(statement, ast.ClassDef)
            yield from _of_scope(statement.body, (*scope, statement.name), inside=in_function)
            continue
        if inside:
            name = ".".join(scope)
            yield from ((name, node, roles) for node, roles in _of_statement(statement))
        for block in blocks(statement):
            yield from _of_scope(block, scope, inside=inside)


def blocks(statement: ast.stmt) -> Iterator[list[ast.stmt]]:
    """The blocks of a statement: its body, what it does otherwise, its cases."""
    for name in _BLOCKS:
        yield getattr(statement, name, [])
    for part in (*getattr(statement, "handlers", ()), *getattr(statement, "cases", ())):
        yield part.body


_Pairs = Iterator[tuple[ast.expr, tuple[_Role, ...]]]


def _of_statement(statement: ast.stmt) -> _Pairs:
    """The expressions of one statement, without those of the statements in it."""
    match statement:
        case ast.Assign(targets=targets, value=value):
            yield from _assigned(targets, value)
        case (
            ast.AugAssign(target=target, value=value)
            | ast.AnnAssign(target=target, value=ast.expr() as value)
        ):
            yield from _assigned([target], value)
        case ast.Return(value=ast.expr() as value):
            yield from _of(value, (AnchorKind.RETURN_VALUE, _text(value), None))
        case ast.If(test=test) | ast.While(test=test) | ast.Assert(test=test):
            yield from _condition(test)
        case ast.For(target=target, iter=value) | ast.AsyncFor(target=target, iter=value):
            yield from _of(value)
            yield from _in_target(target)
        case ast.With(items=items) | ast.AsyncWith(items=items):
            for item in items:
                yield from _of(item.context_expr)
        case ast.Match(subject=subject, cases=cases):
            yield from _of(subject)
            for case in cases:
                if case.guard:
                    yield from _condition(case.guard)
        case ast.Expr(value=value) if not isinstance(value, ast.Constant):
            yield from _of(value)
        case ast.Raise(exc=ast.expr() as value):
            yield from _of(value)


def _assigned(targets: Sequence[ast.expr], value: ast.expr) -> _Pairs:
    yield from _of(value, *((AnchorKind.ASSIGNED_VALUE, _text(target), None) for target in targets))
    for target in targets:
        yield from _in_target(target)


def _condition(test: ast.expr) -> _Pairs:
    yield from _of(test, (AnchorKind.CONDITION, _text(test), None))


def _in_target(target: ast.expr) -> _Pairs:
    """What is calculated to find what is assigned to: an index."""
    match target:
        case ast.Tuple(elts=elements) | ast.List(elts=elements):
            for element in elements:
                yield from _in_target(element)
        case ast.Starred(value=value):
            yield from _in_target(value)
        case ast.Subscript(value=value, slice=index):
            yield from _base(value)
            yield from _of(index)
        case ast.Attribute(value=value):
            yield from _base(value)


def _base(node: ast.expr) -> _Pairs:
    """What an attribute, an item or a method is taken of: names alone are objects, and no values."""
    if isinstance(node, ast.Attribute):
        yield from _base(node.value)
    elif not isinstance(node, ast.Name):
        yield from _of(node)


def _of(node: ast.expr, *roles: _Role) -> _Pairs:
    """An expression, and those in it."""
    if isinstance(node, ast.JoinedStr):
        yield node, roles  # what is in it has places of its own only from Python 3.12 on
        return
    if isinstance(node, ast.Call):
        roles = (*roles, (AnchorKind.RESULT, _text(node.func), None))
    parts = node.elts if isinstance(node, ast.Tuple) else ()
    if not isinstance(node, _NOT_ALONE) and not any(isinstance(p, ast.Slice | ast.Starred) for p in parts):
        yield node, roles
    match node:
        case ast.Call():
            yield from _call(node)
        case ast.Attribute(value=value):
            yield from _base(value)
        case ast.Subscript(value=value, slice=index):
            yield from _base(value)
            yield from _of(index)
        case ast.IfExp(test=test, body=body, orelse=other):
            yield from _of(body)
            yield from _condition(test)
            yield from _of(other)
        case ast.NamedExpr(target=target, value=value):
            yield from _of(value, (AnchorKind.ASSIGNED_VALUE, _text(target), None))
        case ast.Lambda(body=body):
            yield from _of(body)
        case ast.UnaryOp(operand=ast.Constant()):
            pass  # -1 is one constant
        case ast.ListComp() | ast.SetComp() | ast.GeneratorExp() | ast.DictComp():
            yield from _comprehension(node)
        case _:
            for child in ast.iter_child_nodes(node):
                if isinstance(child, ast.expr):
                    yield from _of(child)


def _call(node: ast.Call) -> _Pairs:
    called = _text(node.func)
    yield from _base(node.func)
    for place, argument in enumerate(node.args, 1):
        yield from _of(argument, (AnchorKind.ARGUMENT, called, str(place)))
    for keyword in node.keywords:
        roles = [(AnchorKind.ARGUMENT, called, keyword.arg)] if keyword.arg else []
        yield from _of(keyword.value, *roles)


def _comprehension(node: ast.ListComp | ast.SetComp | ast.GeneratorExp | ast.DictComp) -> _Pairs:
    made = (node.key, node.value) if isinstance(node, ast.DictComp) else (node.elt,)
    for value in made:
        yield from _of(value)
    for generator in node.generators:
        yield from _of(generator.iter)
        for test in generator.ifs:
            yield from _condition(test)


NO_PARTS: dict[str, object] = {"left": None, "right": None, "called": None, "arguments": []}


def parts_of(expression: Expression) -> dict[str, object]:
    """What templates may use beside the whole: the two sides of an operator (`left`, `right`), what a call
    calls (`called`) and its arguments (`arguments`); None, or empty, where there is no such thing."""
    node, left, right = expression.node, None, None
    if isinstance(node, ast.BinOp):
        left, right = node.left, node.right
    elif isinstance(node, ast.Compare) and len(node.comparators) == 1:
        left, right = node.left, node.comparators[0]
    elif isinstance(node, ast.BoolOp):
        *before, right = node.values
        left = before[0] if len(before) == 1 else ast.BoolOp(node.op, before)
    called, arguments = None, list[str]()
    if isinstance(node, ast.Call):
        called = _enclosed(node.func)
        arguments = [ast.unparse(argument) for argument in (*node.args, *node.keywords)]
    sides = [side and _enclosed(side) for side in (left, right)]
    return {"left": sides[0], "right": sides[1], "called": called, "arguments": arguments}


def enclosed(text: str) -> str:
    """The source of an expression, in parentheses if an operator beside it could tear it apart."""
    return text if isinstance(ast.parse(text, mode="eval").body, _ATOMS) else f"({text})"


def _enclosed(node: ast.expr) -> str:
    text = ast.unparse(node)
    return text if isinstance(node, _ATOMS) else f"({text})"
