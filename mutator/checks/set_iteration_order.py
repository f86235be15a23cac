"""Find where source code depends on the order of a set, which for strings varies with PYTHONHASHSEED.

Finds only sets that the source makes recognizable: literals, calls of `set`, and names of the same function
or attributes of `self` that are assigned a set.
"""

import ast
from collections.abc import Iterator
from dataclasses import dataclass

_SET_CONSTRUCTORS = ("set", "frozenset")
_SET_METHODS = ("union", "intersection", "difference", "symmetric_difference", "copy")
# `sum` is among them, because adding floats in another order rounds differently
_ORDER_DEPENDENT_FUNCTIONS = (
    "list",
    "tuple",
    "iter",
    "enumerate",
    "zip",
    "map",
    "filter",
    "sum",
    "reversed",
    "next",
)
# functions whose result does not depend on the order
_ORDER_FREE_FUNCTIONS = ("sorted", "min", "max", "any", "all", "len", *_SET_CONSTRUCTORS)
_ORDER_DEPENDENT_METHODS = (".join", ".extend", ".fromkeys")
_MOST_SOURCE_CHARACTERS = 60  # longest shown expression, in characters


@dataclass(frozen=True, slots=True, kw_only=True)
class SetOrderUse:
    line: int
    function: str
    set_source: str


def list_set_order_uses(source: bytes) -> list[SetOrderUse]:
    """All places in a Python file that depend on the order of a set, by line; empty if the source is not
    valid Python.
    """
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError):
        return []
    uses = {
        (use.line, use.set_source): use
        for use in _SetUseScope(tree, "<module>", frozenset()).set_order_uses()
    }
    return sorted(uses.values(), key=lambda use: use.line)


class _SetUseScope:
    """A module, class or function, with its names that hold sets."""

    def __init__(self, node: ast.AST, name: str, outer: frozenset[str]) -> None:
        self.name = name
        self._node = node
        self._scope_nodes = list(_nodes_in_scope(node))
        self._order_free_arguments = self._arguments_of_order_free_calls()
        self.set_names = outer
        for _ in range(2):  # twice, because a name can be assigned from another
            self.set_names |= frozenset(self._names_assigned_sets())

    def set_order_uses(self) -> Iterator[SetOrderUse]:
        for node in self._scope_nodes:
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                prefix = "" if self.name == "<module>" else f"{self.name}."
                yield from _SetUseScope(node, prefix + node.name, self.set_names).set_order_uses()
            elif set_expression := next(
                (
                    expression
                    for expression in self._expressions_iterated_in_order(node)
                    if self._is_set(expression)
                ),
                None,
            ):
                line = getattr(node, "lineno", set_expression.lineno)
                yield SetOrderUse(line=line, function=self.name, set_source=_shortened_source(set_expression))

    def _names_assigned_sets(self) -> Iterator[str]:
        """Names and attributes of `self` that are assigned a set. For a class, those of all methods."""
        within = ast.walk(self._node) if isinstance(self._node, ast.ClassDef) else self._scope_nodes
        for node in within:
            targets: list[ast.expr] = []
            if isinstance(node, ast.Assign) and self._is_set(node.value):
                targets = node.targets
            elif isinstance(node, ast.AnnAssign) and (
                _is_set_annotation(node.annotation) or self._is_set(node.value)
            ):
                targets = [node.target]
            for target in targets:
                if isinstance(target, ast.Attribute) or not isinstance(self._node, ast.ClassDef):
                    yield ast.unparse(target)

    def _is_set(self, node: ast.expr | None) -> bool:
        if isinstance(node, ast.Set | ast.SetComp):
            return True
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitOr | ast.BitAnd | ast.Sub | ast.BitXor):
            return any(self._is_set(operand) or _is_keys_call(operand) for operand in (node.left, node.right))
        if isinstance(node, ast.Call):
            function = node.func
            if isinstance(function, ast.Attribute):
                return function.attr in _SET_METHODS and self._is_set(function.value)
            return isinstance(function, ast.Name) and function.id in _SET_CONSTRUCTORS
        return isinstance(node, ast.Name | ast.Attribute) and ast.unparse(node) in self.set_names

    def _expressions_iterated_in_order(self, node: ast.AST) -> Iterator[ast.expr]:
        """Yield the expressions that a node iterates over in order."""
        if isinstance(node, ast.For | ast.AsyncFor):
            yield node.iter
        elif isinstance(node, ast.ListComp | ast.DictComp | ast.GeneratorExp):
            if node not in self._order_free_arguments:
                yield from (generator.iter for generator in node.generators)
        elif isinstance(node, ast.Starred):
            yield node.value
        elif isinstance(node, ast.Call):
            function = node.func
            if isinstance(function, ast.Attribute) and function.attr == "pop" and not node.args:
                yield function.value
            elif _called_name(function) in (*_ORDER_DEPENDENT_FUNCTIONS, *_ORDER_DEPENDENT_METHODS):
                yield from node.args

    def _arguments_of_order_free_calls(self) -> list[ast.expr]:
        """Return the arguments of functions whose result does not depend on the order."""
        calls = (
            node
            for node in self._scope_nodes
            if isinstance(node, ast.Call) and _called_name(node.func) in _ORDER_FREE_FUNCTIONS
        )
        return [argument for node in calls for argument in node.args]


def _nodes_in_scope(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes of a scope. Of a nested function or class, only its own node is included."""
    for child in ast.iter_child_nodes(node):
        yield child
        if not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield from _nodes_in_scope(child)


def _called_name(function: ast.expr) -> str:
    if isinstance(function, ast.Attribute):
        return f".{function.attr}"
    return function.id if isinstance(function, ast.Name) else ""


def _is_set_annotation(annotation: ast.expr) -> bool:
    return ast.unparse(annotation).partition("[")[0].rpartition(".")[2].lower() in _SET_CONSTRUCTORS


def _is_keys_call(node: ast.expr) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "keys"


def _shortened_source(node: ast.expr) -> str:
    text = ast.unparse(node)
    return text if len(text) <= _MOST_SOURCE_CHARACTERS else f"{text[:_MOST_SOURCE_CHARACTERS]}..."
