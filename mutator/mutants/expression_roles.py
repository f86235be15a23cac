"""Lists the expressions of a function and the role of each, using Python's parser."""

import ast
from collections.abc import Iterable, Iterator, Sequence

from mutator.model import AnchorKind

Role = tuple[AnchorKind, str, str | None]  # an anchor's kind, name and `which`
Found = tuple[str, ast.expr, tuple[Role, ...]]

_NOT_ALONE = ast.Starred | ast.Slice | ast.GeneratorExp | ast.Yield | ast.YieldFrom
_BLOCKS = ("body", "orelse", "finalbody")


def source_of(node: ast.AST) -> str:
    """Return the source of a node, or "" if `ast` cannot write it.

    `ast` fails for ints of thousands of digits, and for f-strings with a backslash inside braces.
    """
    try:
        return ast.unparse(node)
    except ValueError:
        return ""


def expressions_in(tree: ast.Module) -> Iterator[Found]:
    """Yield function name, expression and roles for each expression in a function's body."""
    yield from _of_scope(tree.body, (), inside=False)


def _of_scope(body: Iterable[ast.stmt], scope: tuple[str, ...], *, inside: bool) -> Iterator[Found]:
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
    """Yield the blocks of a statement: its body, alternatives, cases."""
    for name in _BLOCKS:
        yield getattr(statement, name, [])
    for part in (*getattr(statement, "handlers", ()), *getattr(statement, "cases", ())):
        yield part.body


_Pairs = Iterator[tuple[ast.expr, tuple[Role, ...]]]


def _of_statement(statement: ast.stmt) -> _Pairs:
    match statement:
        case ast.Assign(targets=targets, value=value):
            yield from _assigned(targets, value)
        case (
            ast.AugAssign(target=target, value=value)
            | ast.AnnAssign(target=target, value=ast.expr() as value)
        ):
            yield from _assigned([target], value)
        case ast.Return(value=ast.expr() as value):
            yield from _of(value, (AnchorKind.RETURN_VALUE, source_of(value), None))
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
    yield from _of(value, *((AnchorKind.ASSIGNED_VALUE, source_of(target), None) for target in targets))
    for target in targets:
        yield from _in_target(target)


def _condition(test: ast.expr) -> _Pairs:
    yield from _of(test, (AnchorKind.CONDITION, source_of(test), None))


def _in_target(target: ast.expr) -> _Pairs:
    """Yield the expressions evaluated to find an assignment's target, such as an index."""
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
    """Yield the object of an attribute, item or method. Plain names are skipped."""
    if isinstance(node, ast.Attribute):
        yield from _base(node.value)
    elif not isinstance(node, ast.Name):
        yield from _of(node)


def _of(node: ast.expr, *roles: Role) -> _Pairs:
    if isinstance(node, ast.JoinedStr):
        yield node, roles  # before Python 3.12, the expressions inside it have no positions
        return
    if isinstance(node, ast.Call):
        roles = (*roles, (AnchorKind.RESULT, source_of(node.func), None))
    parts = node.elts if isinstance(node, ast.Tuple) else ()
    if not isinstance(node, _NOT_ALONE) and not any(isinstance(p, ast.Slice | ast.Starred) for p in parts):
        yield node, roles
    match node:
        case ast.Call():
            yield from _call(node)
        case ast.Attribute() | ast.Subscript():
            yield from _in_target(node)
        case ast.IfExp(test=test, body=body, orelse=other):
            yield from _of(body)
            yield from _condition(test)
            yield from _of(other)
        case ast.NamedExpr(target=target, value=value):
            yield from _of(value, (AnchorKind.ASSIGNED_VALUE, source_of(target), None))
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
    called = source_of(node.func)
    yield from _base(node.func)
    for number, argument in enumerate(node.args, 1):
        yield from _of(argument, (AnchorKind.ARGUMENT, called, str(number)))
    for keyword in node.keywords:
        roles = [(AnchorKind.ARGUMENT, called, keyword.arg)] if keyword.arg else []
        yield from _of(keyword.value, *roles)


def _comprehension(node: ast.ListComp | ast.SetComp | ast.GeneratorExp | ast.DictComp) -> _Pairs:
    values = (node.key, node.value) if isinstance(node, ast.DictComp) else (node.elt,)
    for value in values:
        yield from _of(value)
    for generator in node.generators:
        yield from _of(generator.iter)
        for test in generator.ifs:
            yield from _condition(test)
