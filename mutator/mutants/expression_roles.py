"""Lists the expressions of a function and the role of each, using Python's parser."""

import ast
from collections.abc import Iterable, Iterator, Sequence

from mutator.model import AnchorKind

AnchorRole = tuple[AnchorKind, str, str | None]  # an anchor's kind, name and `which`
ExpressionInFunction = tuple[str, ast.expr, tuple[AnchorRole, ...]]

# a star or a slice is no value, a generator expression can share its parentheses with a call, and
# templates refuse `yield`
_UNCHANGEABLE_NODES = ast.Starred | ast.Slice | ast.GeneratorExp | ast.Yield | ast.YieldFrom
# f-strings and, since Python 3.14, t-strings
FORMATTED_STRING_NODES: tuple[type[ast.expr], ...] = (
    ast.JoinedStr,
    getattr(ast, "TemplateStr", ast.JoinedStr),
)
# lists of statements; handlers and cases are nodes with a body of their own
_BLOCK_FIELDS = ("body", "orelse", "finalbody")


def source_of(node: ast.AST) -> str:
    """Return the source of a node, or "" if `ast` cannot write it.

    `ast` fails for ints of thousands of digits, and for f-strings with a backslash inside braces.
    """
    try:
        return ast.unparse(node)
    except ValueError:
        return ""


def expressions_in_functions(tree: ast.Module) -> Iterator[ExpressionInFunction]:
    """Yield function name, expression and roles for each expression in a function's body."""
    yield from _expressions_in_scope(tree.body, (), is_in_function=False)


def _expressions_in_scope(
    body: Iterable[ast.stmt], scope: tuple[str, ...], *, is_in_function: bool
) -> Iterator[ExpressionInFunction]:
    for statement in body:
        if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            in_function = not isinstance(statement, ast.ClassDef)
            yield from _expressions_in_scope(
                statement.body, (*scope, statement.name), is_in_function=in_function
            )
            continue
        if is_in_function:
            name = ".".join(scope)
            yield from ((name, node, roles) for node, roles in _expressions_in_statement(statement))
        for block in blocks_of(statement):
            yield from _expressions_in_scope(block, scope, is_in_function=is_in_function)


def blocks_of(statement: ast.stmt) -> Iterator[list[ast.stmt]]:
    """Yield the blocks of a statement: its body, alternatives, cases."""
    for name in _BLOCK_FIELDS:
        yield getattr(statement, name, [])
    for part in (*getattr(statement, "handlers", ()), *getattr(statement, "cases", ())):
        yield part.body


_ExpressionsWithRoles = Iterator[tuple[ast.expr, tuple[AnchorRole, ...]]]


def _expressions_in_statement(statement: ast.stmt) -> _ExpressionsWithRoles:
    match statement:
        case ast.Assign(targets=targets, value=value):
            yield from _expressions_in_assignment(targets, value)
        case (
            ast.AugAssign(target=target, value=value)
            | ast.AnnAssign(target=target, value=ast.expr() as value)
        ):
            yield from _expressions_in_assignment([target], value)
        case ast.Return(value=ast.expr() as value):
            yield from _expression_and_nested(value, (AnchorKind.RETURN_VALUE, source_of(value), None))
        case ast.If(test=test) | ast.While(test=test) | ast.Assert(test=test):
            yield from _expressions_in_condition(test)
        case ast.For(target=target, iter=value) | ast.AsyncFor(target=target, iter=value):
            yield from _expression_and_nested(value)
            yield from _expressions_in_assignment_target(target)
        case ast.With(items=items) | ast.AsyncWith(items=items):
            for item in items:
                yield from _expression_and_nested(item.context_expr)
        case ast.Match(subject=subject, cases=cases):
            yield from _expression_and_nested(subject)
            for case in cases:
                if case.guard:
                    yield from _expressions_in_condition(case.guard)
        case ast.Expr(value=value) if not isinstance(value, ast.Constant):
            yield from _expression_and_nested(value)
        case ast.Raise(exc=ast.expr() as value):
            yield from _expression_and_nested(value)


def _expressions_in_assignment(targets: Sequence[ast.expr], value: ast.expr) -> _ExpressionsWithRoles:
    yield from _expression_and_nested(
        value, *((AnchorKind.ASSIGNED_VALUE, source_of(target), None) for target in targets)
    )
    for target in targets:
        yield from _expressions_in_assignment_target(target)


def _expressions_in_condition(test: ast.expr) -> _ExpressionsWithRoles:
    yield from _expression_and_nested(test, (AnchorKind.CONDITION, source_of(test), None))


def _expressions_in_assignment_target(target: ast.expr) -> _ExpressionsWithRoles:
    """Yield the expressions evaluated to find an assignment's target, such as an index."""
    match target:
        case ast.Tuple(elts=elements) | ast.List(elts=elements):
            for element in elements:
                yield from _expressions_in_assignment_target(element)
        case ast.Starred(value=value):
            yield from _expressions_in_assignment_target(value)
        case ast.Subscript(value=value, slice=index):
            yield from _expressions_in_accessed_object(value)
            yield from _expression_and_nested(index)
        case ast.Attribute(value=value):
            yield from _expressions_in_accessed_object(value)


def _expressions_in_accessed_object(node: ast.expr) -> _ExpressionsWithRoles:
    """Yield the object of an attribute, item or method. Plain names are skipped."""
    if isinstance(node, ast.Attribute):
        yield from _expressions_in_accessed_object(node.value)
    elif not isinstance(node, ast.Name):
        yield from _expression_and_nested(node)


def _expression_and_nested(node: ast.expr, *roles: AnchorRole) -> _ExpressionsWithRoles:
    if isinstance(node, FORMATTED_STRING_NODES):
        yield node, roles  # before Python 3.12, the expressions inside it have no positions
        return
    if isinstance(node, ast.Call):
        roles = (*roles, (AnchorKind.RESULT, source_of(node.func), None))
    parts = node.elts if isinstance(node, ast.Tuple) else ()
    if not isinstance(node, _UNCHANGEABLE_NODES) and not any(
        isinstance(p, ast.Slice | ast.Starred) for p in parts
    ):
        yield node, roles
    match node:
        case ast.Call():
            yield from _expressions_in_call(node)
        case ast.Attribute() | ast.Subscript():
            yield from _expressions_in_assignment_target(node)
        case ast.IfExp(test=test, body=body, orelse=other):
            yield from _expression_and_nested(body)
            yield from _expressions_in_condition(test)
            yield from _expression_and_nested(other)
        case ast.NamedExpr(target=target, value=value):
            yield from _expression_and_nested(value, (AnchorKind.ASSIGNED_VALUE, source_of(target), None))
        case ast.Lambda(body=body):
            yield from _expression_and_nested(body)
        case ast.UnaryOp(operand=ast.Constant()):
            pass  # -1 is one constant
        case ast.ListComp() | ast.SetComp() | ast.GeneratorExp() | ast.DictComp():
            yield from _expressions_in_comprehension(node)
        case _:
            for child in ast.iter_child_nodes(node):
                if isinstance(child, ast.expr):
                    yield from _expression_and_nested(child)


def _expressions_in_call(node: ast.Call) -> _ExpressionsWithRoles:
    called = source_of(node.func)
    yield from _expressions_in_accessed_object(node.func)
    for number, argument in enumerate(node.args, 1):
        yield from _expression_and_nested(argument, (AnchorKind.ARGUMENT, called, str(number)))
    for keyword in node.keywords:
        roles = [(AnchorKind.ARGUMENT, called, keyword.arg)] if keyword.arg else []
        yield from _expression_and_nested(keyword.value, *roles)


def _expressions_in_comprehension(
    node: ast.ListComp | ast.SetComp | ast.GeneratorExp | ast.DictComp,
) -> _ExpressionsWithRoles:
    values = (node.key, node.value) if isinstance(node, ast.DictComp) else (node.elt,)
    for value in values:
        yield from _expression_and_nested(value)
    for generator in node.generators:
        yield from _expression_and_nested(generator.iter)
        for test in generator.ifs:
            yield from _expressions_in_condition(test)
