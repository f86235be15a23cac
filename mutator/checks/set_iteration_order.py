"""Find where source code depends on the order of a set, which for strings varies with PYTHONHASHSEED.

Finds only sets that the source makes recognizable: literals, calls of `set`, and names of the same function
or attributes of `self` that are assigned a set.
"""

import ast
from collections.abc import Iterator
from dataclasses import dataclass

_MAKING = ("set", "frozenset")
_KEEPING = ("union", "intersection", "difference", "symmetric_difference", "copy")
_ORDERED = ("list", "tuple", "iter", "enumerate", "zip", "map", "filter", "sum", "reversed", "next")
# functions whose result does not depend on the order
_UNORDERED = ("sorted", "min", "max", "any", "all", "len", *_MAKING)
_METHODS = (".join", ".extend", ".fromkeys")
_SHORT = 60  # longest shown expression, in characters


@dataclass(frozen=True, slots=True, kw_only=True)
class SetOrder:
    line: int
    function: str
    what: str


def places(source: bytes) -> list[SetOrder]:
    """All places in a Python file that depend on the order of a set, by line; empty if the source is not
    valid Python.
    """
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError):
        return []
    found = {(one.line, one.what): one for one in _Scope(tree, "<module>", frozenset()).places()}
    return sorted(found.values(), key=lambda one: one.line)


class _Scope:
    """A module, class or function, with its names that hold sets."""

    def __init__(self, node: ast.AST, name: str, outer: frozenset[str]) -> None:
        self.name = name
        self._node = node
        self._own = list(_own(node))
        self._orderless = self._to_be_ordered()
        self.sets = outer
        for _ in range(2):  # twice, because a name can be assigned from another
            self.sets |= frozenset(self._assigned())

    def places(self) -> Iterator[SetOrder]:
        for node in self._own:
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                prefix = "" if self.name == "<module>" else f"{self.name}."
                yield from _Scope(node, prefix + node.name, self.sets).places()
            elif used := next((one for one in self._in_order(node) if self._is_set(one)), None):
                line = getattr(node, "lineno", used.lineno)
                yield SetOrder(line=line, function=self.name, what=_text(used))

    def _assigned(self) -> Iterator[str]:
        """Names and attributes of `self` that are assigned a set. For a class, those of all methods."""
        within = ast.walk(self._node) if isinstance(self._node, ast.ClassDef) else self._own
        for node in within:
            targets: list[ast.expr] = []
            if isinstance(node, ast.Assign) and self._is_set(node.value):
                targets = node.targets
            elif isinstance(node, ast.AnnAssign) and (_says_set(node.annotation) or self._is_set(node.value)):
                targets = [node.target]
            for target in targets:
                if isinstance(target, ast.Attribute) or not isinstance(self._node, ast.ClassDef):
                    yield ast.unparse(target)

    def _is_set(self, node: ast.expr | None) -> bool:
        if isinstance(node, ast.Set | ast.SetComp):
            return True
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitOr | ast.BitAnd | ast.Sub | ast.BitXor):
            return any(self._is_set(one) or _is_keys(one) for one in (node.left, node.right))
        if isinstance(node, ast.Call):
            function = node.func
            if isinstance(function, ast.Attribute):
                return function.attr in _KEEPING and self._is_set(function.value)
            return isinstance(function, ast.Name) and function.id in _MAKING
        return isinstance(node, ast.Name | ast.Attribute) and ast.unparse(node) in self.sets

    def _in_order(self, node: ast.AST) -> Iterator[ast.expr]:
        """Yield the expressions that a node iterates over in order."""
        if isinstance(node, ast.For | ast.AsyncFor):
            yield node.iter
        elif isinstance(node, ast.ListComp | ast.DictComp | ast.GeneratorExp):
            if node not in self._orderless:
                yield from (one.iter for one in node.generators)
        elif isinstance(node, ast.Starred):
            yield node.value
        elif isinstance(node, ast.Call):
            function = node.func
            if isinstance(function, ast.Attribute) and function.attr == "pop" and not node.args:
                yield function.value
            elif _called(function) in (*_ORDERED, *_METHODS):
                yield from node.args

    def _to_be_ordered(self) -> list[ast.expr]:
        """Return the arguments of functions whose result does not depend on the order."""
        calls = (one for one in self._own if isinstance(one, ast.Call) and _called(one.func) in _UNORDERED)
        return [argument for one in calls for argument in one.args]


def _own(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes of a scope. Of a nested function or class, only its own node is included."""
    for child in ast.iter_child_nodes(node):
        yield child
        if not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield from _own(child)


def _called(function: ast.expr) -> str:
    if isinstance(function, ast.Attribute):
        return f".{function.attr}"
    return function.id if isinstance(function, ast.Name) else ""


def _says_set(annotation: ast.expr) -> bool:
    return ast.unparse(annotation).partition("[")[0].rpartition(".")[2].lower() in _MAKING


def _is_keys(node: ast.expr) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "keys"


def _text(node: ast.expr) -> str:
    text = ast.unparse(node)
    return text if len(text) <= _SHORT else f"{text[:_SHORT]}..."
