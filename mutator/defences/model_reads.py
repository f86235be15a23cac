"""What a model reads and commands, as far as its syntax tree says it: `sensed["gap"]`, `applied["force"]`."""

import ast
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Reads:
    """The names that a function reads from a mapping. `reads_others`: it may read any other name, too.

    `line_by_required_name` has those without which it fails; those that it asks for first (`get`, `in`) are
    only in `names`.
    """

    names: frozenset[str] = frozenset()
    line_by_required_name: tuple[tuple[str, int], ...] = ()
    reads_others: bool = False


def reads_of(function: ast.FunctionDef, argument: str) -> Reads:
    """Return what a function reads from one of its arguments, a mapping with texts as keys."""
    parents = {child: node for node in ast.walk(function) for child in ast.iter_child_nodes(node)}
    attempts = {
        inner
        for node in ast.walk(function)
        if isinstance(node, ast.Try)
        for statement in node.body
        for inner in ast.walk(statement)
    }
    required: dict[str, int] = {}
    optional = set[str]()
    reads_others = False
    for node in ast.walk(function):
        if not (isinstance(node, ast.Name) and node.id == argument):
            continue
        parent = parents[node]
        match parent:
            case ast.Subscript(value=value, slice=ast.Constant(value=str(name)), ctx=ast.Load()) if (
                value is node
            ):
                if parent in attempts:
                    optional.add(name)
                else:
                    required.setdefault(name, parent.lineno)
            case ast.Compare(
                left=ast.Constant(value=str(name)), ops=[ast.In() | ast.NotIn()], comparators=[value]
            ) if value is node:
                optional.add(name)
            case ast.Attribute(attr="get"):
                match parents[parent]:
                    case ast.Call(func=func, args=[ast.Constant(value=str(name)), *_]) if func is parent:
                        optional.add(name)
                    case _:
                        reads_others = True
            case _:
                reads_others = True
    return Reads(
        names=frozenset(required) | optional,
        line_by_required_name=tuple(item for item in required.items() if item[0] not in optional),
        reads_others=reads_others,
    )


def commands_of(update: ast.FunctionDef) -> tuple[str, ...]:
    """Return the commands for which `update` returns ranges whenever it comes to its last statement.

    Only what is written out there counts: `{"force": ...}`, such a mapping with a name, and `|` of them.
    """
    value_by_name: dict[str, ast.expr] = {}
    for statement in update.body:
        match statement:
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                value_by_name[name] = value
            case ast.Return(value=ast.expr() as value):
                return tuple(dict.fromkeys(_keys_of(value, value_by_name)))
    return ()


def _keys_of(value: ast.expr, value_by_name: dict[str, ast.expr]) -> list[str]:
    match value:
        case ast.Dict(keys=keys):
            return [key.value for key in keys if isinstance(key, ast.Constant) and isinstance(key.value, str)]
        case ast.BinOp(left=left, op=ast.BitOr(), right=right):
            return [*_keys_of(left, value_by_name), *_keys_of(right, value_by_name)]
        case ast.Name(id=name) if isinstance(value_by_name.get(name), ast.Dict):
            return _keys_of(value_by_name[name], {})
        case _:
            return []
