"""The `where` of an injection: a condition that selects one instance among several."""

import ast

from mutator.config.location_syntax import PROBE_MODULE_NAME

_MOST_LENGTH = 1000  # characters; the condition becomes part of one line of the mutant
# no calls: the condition is evaluated in the controller's function, and must not change anything
_ALLOWED_NODES = (
    *(ast.Expression, ast.BoolOp, ast.And, ast.Or, ast.UnaryOp, ast.Not, ast.USub, ast.Compare, ast.cmpop),
    *(ast.Name, ast.Load, ast.Attribute, ast.Subscript, ast.Constant, ast.Tuple),
)


def canonical_instance_condition(text: str) -> str:
    """Return the condition in the form that mutants contain.

    ValueError unless it consists of names, attributes, items, constants, comparisons, `and`, `or` and `not`.
    """
    try:
        tree = ast.parse(text.strip(), mode="eval") if len(text) <= _MOST_LENGTH else None
    except (SyntaxError, RecursionError, MemoryError):
        tree = None
    plain = tree is not None and all(isinstance(node, _ALLOWED_NODES) for node in ast.walk(tree))
    # `ast` ignores a comment, which would swallow what follows the condition in the mutant's line
    if tree is None or not plain or PROBE_MODULE_NAME in names_in_condition(text) or "#" in text:
        raise ValueError(text)
    return ast.unparse(tree)


def names_in_condition(text: str) -> frozenset[str]:
    tree = ast.parse(text.strip(), mode="eval")
    return frozenset(node.id for node in ast.walk(tree) if isinstance(node, ast.Name))
