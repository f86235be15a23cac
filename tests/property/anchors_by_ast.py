"""Every anchor that the documentation promises for a source, found by `ast` alone."""

import ast
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from mutator.model import Anchor, AnchorKind, FaultLocation

AFTER = (AnchorKind.AFTER_ASSIGN, AnchorKind.AFTER_CALL)
BEFORE = (AnchorKind.BEFORE_ASSIGN, AnchorKind.BEFORE_CALL, AnchorKind.BEFORE_RETURN)
_Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True, slots=True)
class Spot:
    """A location, the statement (or the function entry) that it names, and the function around it."""

    location: FaultLocation
    node: ast.stmt
    within: _Function

    @property
    def kind(self) -> AnchorKind:
        return self.location.anchor.kind


def spots(tree: ast.Module) -> Iterator[Spot]:
    """Yield every anchor. `nth` numbers the statements of one kind and name."""
    functions: dict[str, list[_Function]] = {}
    for name, function in _functions(tree, ""):
        functions.setdefault(name, []).append(function)
    for name, found in functions.items():
        for nth, function in enumerate(found, 1):
            yield Spot(_location(name, AnchorKind.ENTRY, "", nth), function, function)
        counts: Counter[tuple[str, str]] = Counter()
        for function, statement in ((f, s) for f in found for s in _statements(f.body)):
            for verb, target in dict.fromkeys(_effects(statement)):
                counts[verb, target] += 1
                for kind in (*AFTER, *BEFORE):
                    if kind.partition("_")[2] == verb:
                        location = _location(name, kind, target, counts[verb, target])
                        yield Spot(location, statement, function)


def _location(function: str, kind: AnchorKind, name: str, nth: int) -> FaultLocation:
    return FaultLocation(path="m.py", function=function, anchor=Anchor(kind=kind, name=name, nth=nth))


def _functions(node: ast.AST, scope: str) -> Iterator[tuple[str, _Function]]:
    for child in ast.iter_child_nodes(node):
        inside = scope
        if isinstance(child, _Function | ast.ClassDef):
            inside = f"{scope}{child.name}."
        if isinstance(child, _Function):
            yield inside[:-1], child
        yield from _functions(child, inside)


def _statements(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    for statement in body:
        yield statement
        if isinstance(statement, _Function | ast.ClassDef):
            continue
        for _, value in ast.iter_fields(statement):
            for part in value if isinstance(value, list) else ():
                if isinstance(part, ast.stmt):
                    yield from _statements([part])
                elif isinstance(part, ast.ExceptHandler | ast.match_case):
                    yield from _statements(part.body)


def _effects(statement: ast.stmt) -> Iterator[tuple[str, str]]:
    called = None
    if isinstance(statement, ast.Assign | ast.AugAssign | ast.AnnAssign | ast.Expr | ast.Return):
        value = statement.value
        call = value.value if isinstance(value, ast.Await) else value
        called = _dotted(call.func) if isinstance(call, ast.Call) else None
    if isinstance(statement, ast.Assign):
        yield from (("assign", name) for target in statement.targets for name in _targets(target))
    elif isinstance(statement, ast.AugAssign) or (isinstance(statement, ast.AnnAssign) and statement.value):
        yield from (("assign", name) for name in _targets(statement.target))
    if called:
        yield "call", called
    if isinstance(statement, ast.Return):
        yield "return", ""
        if returned := called or _dotted(statement.value):
            yield "return", returned


def _targets(node: ast.expr) -> Iterator[str]:
    if isinstance(node, ast.Tuple | ast.List):
        for element in node.elts:
            yield from _targets(element)
    elif isinstance(node, ast.Starred):
        yield from _targets(node.value)
    elif name := _dotted(node):
        yield name


def _dotted(node: ast.AST | None) -> str | None:
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        base = _dotted(node.value)
        return f"{base}.{node.attr}" if base else None
    return None
