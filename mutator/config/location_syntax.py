"""A place in the target as written in YAML: `{file: ..., function: ..., after_assign: gap}`."""

import ast
import keyword
import re
from typing import Any

from mutator.model import AnchorKind, FaultLocation

PROBE_MODULE_NAME = "_fi"  # reserved for the probe's module in every mutant (mutants/probe_contract.py)
DEFENCE_MODULE_NAME = "_fd"  # reserved for the module that runs the defences of a tree

# what `ast` raises for invalid or too deeply nested source
_INVALID_SOURCE_ERRORS = (SyntaxError, ValueError, RecursionError, MemoryError)


def defence_module_name(defence: str) -> str:
    """Return the name of the module that has a defence's model in a defended tree."""
    return f"{DEFENCE_MODULE_NAME}_{defence}"


def defence_at(path: str) -> str:
    """Return the defence whose model has this path in a defended tree; empty for a file of the target."""
    name = path.rpartition("/")[2].removesuffix(".py")
    prefix = defence_module_name("")
    return name.removeprefix(prefix) if name.startswith(prefix) else ""


def location_as_yaml(location: FaultLocation) -> dict[str, Any]:
    anchor = location.anchor
    defence = defence_at(location.path)
    keys: dict[str, Any] = {"defence": defence} if defence else {"file": location.path}
    keys |= {"function": location.function} if location.function else {}
    keys[anchor.kind.value] = anchor.name if anchor.kind is not AnchorKind.ENTRY else True
    if anchor.which is not None:
        keys["which"] = int(anchor.which) if anchor.which.isdecimal() else anchor.which
    return keys | ({"nth": anchor.nth} if anchor.nth is not None else {})


def is_expression(text: str) -> bool:
    """Whether `text` is a Python expression that does not use the probe."""
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except _INVALID_SOURCE_ERRORS:
        return False
    return not any(isinstance(node, ast.Name) and node.id == PROBE_MODULE_NAME for node in ast.walk(tree))


def is_assignable(text: str) -> bool:
    """Whether `text` is an assignment target of names, attributes, and items by constant or name only."""
    try:
        node: ast.expr = ast.parse(text, mode="eval").body
        ast.parse(f"({text})", mode="eval")  # a comment would swallow the bracket
    except _INVALID_SOURCE_ERRORS:
        return False
    whole = isinstance(node, ast.Name | ast.Attribute | ast.Subscript) and _is_attribute_chain(node)
    return whole and text.isprintable()  # excludes line breaks


def is_message_expression(text: str) -> bool:
    """Whether `text` is `message` with attributes, items by constant, and calls without arguments."""
    try:
        node: ast.expr = ast.parse(text, mode="eval").body
        ast.parse(f"({text})", mode="eval")  # a comment would swallow the bracket
    except _INVALID_SOURCE_ERRORS:
        return False
    while not isinstance(node, ast.Name):
        match node:
            case ast.Attribute(value=inner) | ast.Call(func=inner, args=[], keywords=[]):
                node = inner
            case ast.Subscript(value=inner, slice=index) if _is_constant(index):
                node = inner
            case _:
                return False
    return node.id == "message" and text.isprintable()


def base_variable(text: str) -> str:
    return re.split(r"[.\[\s]", text, maxsplit=1)[0]


def _is_attribute_chain(node: ast.expr) -> bool:
    match node:
        case ast.Name(id=name):
            return name != PROBE_MODULE_NAME
        case ast.Attribute(value=value):
            return _is_attribute_chain(value)
        case ast.Subscript(value=value, slice=index):
            return _is_attribute_chain(value) and (_is_constant(index) or _is_attribute_chain(index))
    return False


def _is_constant(node: ast.expr) -> bool:
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        node = node.operand
    return isinstance(node, ast.Constant) and isinstance(node.value, str | int)


def is_dotted_name(text: str) -> bool:
    """Whether `text` is a chain of identifiers that does not start with the probe's name."""
    parts = text.split(".")
    return all(p.isidentifier() and not keyword.iskeyword(p) for p in parts) and parts[0] != PROBE_MODULE_NAME
