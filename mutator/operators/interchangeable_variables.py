"""Finds the variables of a function that could stand for one another: of the same kind, and bound.

The kind is the type in golden runs. Without one, it follows from how the source assigns the names: by a
number, by a call of the same function, as parts of one value, as parameters.
"""

import ast
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import SequenceMatcher

from mutator.mutants.expression_roles import blocks_of

_MOST_REPLACEMENTS = 3  # the names that are nearest in spelling: those that one confuses
_OWN_OBJECT_NAMES = ("self", "cls")
_Function = ast.FunctionDef | ast.AsyncFunctionDef
_Comprehension = ast.ListComp | ast.SetComp | ast.DictComp | ast.GeneratorExp
TypesByName = Mapping[str, str]  # all types that a name has when a line begins, as one text


@dataclass(slots=True, kw_only=True)
class LocalName:
    """A local name, and the lines (from 1) on which it is certainly bound, if the source says so."""

    kinds: set[str] = field(default_factory=set)
    bound_lines: range = range(0)
    is_deleted: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class FunctionNames:
    """The local names of a function on `lines` (from 1, with nested functions)."""

    lines: range
    names: Mapping[str, LocalName]
    inner_names: tuple[
        tuple[range, frozenset[str]], ...
    ]  # names of comprehensions and lambdas, with their lines


def replacements_of_name(
    functions: Sequence[FunctionNames], node: ast.Name, types: TypesByName | None
) -> list[str]:
    """Return the variables that can stand for a name that is read: the nearest in spelling first.

    `types` are those of the golden runs where the statement begins; None without golden runs.
    """
    around = [function for function in functions if node.lineno in function.lines[1:]]
    if not around:
        return []
    function = max(around, key=lambda candidate: candidate.lines.start)
    hidden = {n for lines, names in function.inner_names if node.lineno in lines for n in names}
    if node.id in {*hidden, *_OWN_OBJECT_NAMES} or node.id not in function.names:
        return []
    others = [name for name in function.names if name != node.id and name not in hidden]
    if types is None:
        others = [name for name in others if _are_alike(function.names, node, name)]
    else:
        others = [name for name in others if node.id in types and types.get(name) == types[node.id]]
    others = [name for name in others if name not in _OWN_OBJECT_NAMES]
    return sorted(others, key=lambda name: (-_similarity(node.id, name), name))[:_MOST_REPLACEMENTS]


def _are_alike(names: Mapping[str, LocalName], node: ast.Name, other: str) -> bool:
    name, candidate = names[node.id], names[other]
    is_bound = node.lineno in candidate.bound_lines and not candidate.is_deleted
    return is_bound and len(name.kinds) == 1 and name.kinds == candidate.kinds


def _similarity(first: str, second: str) -> float:
    return SequenceMatcher(None, first, second).ratio()


def names_of_functions(module: ast.Module) -> tuple[FunctionNames, ...]:
    return tuple(_names_of_function(node) for node in ast.walk(module) if isinstance(node, _Function))


def _names_of_function(function: _Function) -> FunctionNames:
    names: dict[str, LocalName] = {}
    lines = range(function.lineno, (function.end_lineno or function.lineno) + 1)
    for argument, default in _arguments_with_defaults(function.args):
        kind = ast.unparse(argument.annotation) if argument.annotation else _kind_of_value(default)
        names[argument.arg] = LocalName(kinds={f"parameter {kind or ''}"}, bound_lines=lines)
    outer_names = set[str]()
    for statement, end in _statements(function.body, lines.stop):
        if isinstance(statement, ast.Global | ast.Nonlocal):
            outer_names.update(statement.names)
        if isinstance(statement, ast.Delete):
            for target in statement.targets:
                if isinstance(target, ast.Name):
                    names.setdefault(target.id, LocalName()).is_deleted = True
        for name, kind in _bound_names(statement):
            local = names.setdefault(name, LocalName())
            local.kinds.add(kind)
            begin = (statement.end_lineno or statement.lineno) + 1
            if isinstance(statement, ast.Assign | ast.AnnAssign) and not local.bound_lines:
                local.bound_lines = range(begin, end)
    inner = tuple(
        (range(node.lineno, (node.end_lineno or node.lineno) + 1), frozenset(_inner_names(node)))
        for node in ast.walk(function)
        if isinstance(node, _Comprehension | ast.Lambda)
    )
    local_names = {name: local for name, local in names.items() if name not in outer_names}
    return FunctionNames(lines=lines, names=local_names, inner_names=inner)


def _statements(body: Sequence[ast.stmt], end: int) -> Iterator[tuple[ast.stmt, int]]:
    """Yield a function's statements, each with the line at which its block ends; none of nested scopes."""
    for statement in body:
        yield statement, end
        if not isinstance(statement, _Function | ast.ClassDef):
            for block in blocks_of(statement):
                if block:
                    yield from _statements(block, (block[-1].end_lineno or block[-1].lineno) + 1)


def _bound_names(statement: ast.stmt) -> Iterator[tuple[str, str]]:
    """Yield the names that a statement binds, with the kind of their values."""
    match statement:
        case ast.Assign(targets=targets, value=value):
            for target in targets:
                yield from _names_in_target(
                    target, _kind_of_value(value) or f"line {statement.lineno}", value
                )
        case ast.AnnAssign(target=ast.Name(id=name), annotation=annotation, value=ast.expr()):
            yield name, f"annotated {ast.unparse(annotation)}"
        case ast.For(target=target, iter=iterated) | ast.AsyncFor(target=target, iter=iterated):
            yield from _names_in_target(target, f"item of {ast.unparse(iterated)}", None)
        case ast.AugAssign() | ast.Expr() | ast.Return() | ast.If() | ast.While():
            return
        case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
            yield name, f"line {statement.lineno}"
        case ast.Import(names=aliases) | ast.ImportFrom(names=aliases):
            for alias in aliases:
                yield alias.asname or alias.name.partition(".")[0], f"line {statement.lineno}"
        case ast.With(items=items) | ast.AsyncWith(items=items):
            for item in items:
                if item.optional_vars is not None:
                    yield from _names_in_target(item.optional_vars, f"line {statement.lineno}", None)


def _names_in_target(target: ast.expr, kind: str, value: ast.expr | None) -> Iterator[tuple[str, str]]:
    match target:
        case ast.Name(id=name):
            yield name, kind
        case ast.Tuple(elts=parts) | ast.List(elts=parts):
            values = value.elts if isinstance(value, ast.Tuple | ast.List) else []
            for i, part in enumerate(parts):
                part_kind = _kind_of_value(values[i]) if len(values) == len(parts) else f"part of {kind}"
                yield from _names_in_target(part, part_kind or f"line {part.lineno}", None)
        case ast.Starred(value=part):
            yield from _names_in_target(part, f"rest of {kind}", None)


def _kind_of_value(value: ast.expr | None) -> str | None:
    """Return the kind of an expression's value; None if the source does not say it."""
    match value:
        case ast.Constant(value=constant):
            return type(constant).__name__
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            return _kind_of_value(operand) or "arithmetic"
        case ast.BinOp():
            return "arithmetic"
        case ast.Compare() | ast.UnaryOp(op=ast.Not()):
            return "truth value"
        case ast.Call(func=called):
            return f"result of {ast.unparse(called)}"
        case ast.Attribute(value=owner):
            return f"attribute of {ast.unparse(owner)}"
        case ast.Subscript(value=owner):
            return f"item of {ast.unparse(owner)}"
        case ast.List() | ast.Tuple() | ast.Dict() | ast.Set() | ast.ListComp() | ast.JoinedStr():
            return type(value).__name__
    return None


def _arguments_with_defaults(arguments: ast.arguments) -> Iterator[tuple[ast.arg, ast.expr | None]]:
    positional = [*arguments.posonlyargs, *arguments.args]
    missing: list[ast.expr | None] = [None] * (len(positional) - len(arguments.defaults))
    yield from zip(positional, [*missing, *arguments.defaults], strict=True)
    yield from zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)


def _inner_names(node: ast.expr) -> Iterator[str]:
    if isinstance(node, ast.Lambda):
        yield from (argument.arg for argument, _ in _arguments_with_defaults(node.args))
        return
    for generator in node.generators:  # type: ignore[attr-defined]
        for part in ast.walk(generator.target):
            if isinstance(part, ast.Name):
                yield part.id
