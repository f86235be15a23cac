"""A place in the target as YAML writes it: `{file: ..., function: ..., after_assign: gap}`."""

import ast
import keyword
import re
from typing import Any

from pydantic import Field

from mutator.config.yaml_files import Keys, Source, StrictModel
from mutator.model import FIXED_ANCHORS, VALUE_ANCHORS, Anchor, AnchorKind, FaultLocation

PROBE_NAME = "_fi"  # reserved: the module that every mutant has and no target does (mutants/probe.py)

_NAMELESS = (AnchorKind.ENTRY, AnchorKind.BEFORE_RETURN, AnchorKind.RETURN_VALUE, AnchorKind.CONDITION)
_ASSIGNMENTS = (AnchorKind.AFTER_ASSIGN, AnchorKind.BEFORE_ASSIGN)

_NO_PYTHON = (SyntaxError, ValueError, RecursionError, MemoryError)  # what `ast` says of a text that is none


class AtModel(StrictModel, title="A place"):
    """Exactly one anchor is given. It must be found exactly once in the function, in statement position; if
    there are several, the error lists them and `nth` chooses one. Names are as written in the source
    (`gap`, `self.angle`, `frames.extend`)."""

    file: str = Field(description="A file of the target, relative to its root.")
    function: str | None = Field(
        None,
        description="A qualified name: `measure`, `Sonar.measure`, `outer.<locals>.inner`. Every anchor but "
        "`constant` needs it.",
    )
    after_assign: str | None = Field(None, description="After the statement that assigns to this name.")
    before_assign: str | None = Field(None, description="Before the statement that assigns to this name.")
    after_call: str | None = Field(None, description="After the statement that calls this name.")
    before_call: str | None = Field(
        None, description="Before the statement that calls this name; the statement a guard leaves out."
    )
    before_return: str | None = Field(
        None, description="Before the `return` of this name; empty for a bare `return`."
    )
    entry: bool | None = Field(None, description="`true`: at the start of the function.")
    assigned_value: str | None = Field(
        None,
        description="The value that is assigned to this name, wherever that stands (`if a: b = 1`, `:=`).",
    )
    return_value: str | None = Field(
        None, description="The value that the `return` of this expression returns; empty for any."
    )
    condition: str | None = Field(
        None,
        description="What decides an `if`, a `while`, an `assert`, `x if ... else y` or what a comprehension "
        "takes in; empty for any.",
    )
    argument: str | None = Field(
        None, description="An argument of the call of this name; `which` says which, if it has several."
    )
    result: str | None = Field(None, description="What the call of this name gives, within an expression.")
    value: str | None = Field(
        None, description="The value of this expression, as written, spaces and quotes aside."
    )
    constant: str | None = Field(
        None,
        description="A constant of the module (`LIMIT`) or of a class (`PIController.GAIN`), the default of "
        "a dataclass's field included. It is set while the fault is active, also where other modules have "
        "imported it by name, and put back afterwards.",
    )
    default: str | None = Field(
        None,
        description="The default of this parameter of the function, set while the fault is active.",
    )
    which: str | int | None = Field(
        None, description="Of an `argument`: its place in the call, from 1, or its keyword."
    )
    nth: int | None = Field(
        None,
        ge=1,
        description="Which of several hits, counted from 1; heads of blocks count after statements.",
    )

    def location(self, source: Source, keys: Keys) -> FaultLocation:
        """The location; errors point into `source` at `keys`."""
        given = [kind for kind in AnchorKind if getattr(self, kind.value) not in (None, False)]
        if len(given) != 1:
            raise source.error(
                keys,
                f"{len(given)} anchors" + (f" ({', '.join(given)})" if given else ""),
                expected=f"exactly one of {', '.join(AnchorKind)}",
                remedy="name one statement, e.g. `after_assign: gap`",
            )
        kind = given[0]
        name = "" if kind is AnchorKind.ENTRY else getattr(self, kind.value)
        if not (_fits(kind, name) or (not name and kind in _NAMELESS)):
            expected = (
                "an expression as in the source" if kind in VALUE_ANCHORS else "a name as in the source"
            )
            raise source.error((*keys, kind.value), f"'{name}'", expected=expected)
        which = None if self.which is None else str(self.which)
        if which is not None and not (
            kind is AnchorKind.ARGUMENT and (which.isdecimal() or which.isidentifier())
        ):
            raise source.error(
                (*keys, "which"),
                f"'{which}'",
                expected="the place, from 1, or the keyword of an `argument`",
                remedy="correct it, or leave it out",
            )
        if kind in FIXED_ANCHORS and self.nth is not None:
            raise source.error(
                (*keys, "nth"),
                f"`nth` of a {kind.value}",
                expected="none: there is one of each name",
                remedy="leave it out",
            )
        function = self._function_of(kind, source, keys)
        anchor = Anchor(kind=kind, name=name, nth=self.nth, which=which)
        return FaultLocation(path=self.file, function=function, anchor=anchor)

    def _function_of(self, kind: AnchorKind, source: Source, keys: Keys) -> str:
        """The function, which a constant does not have."""
        name = self.function
        if kind is AnchorKind.CONSTANT:
            if name is not None:
                raise source.error(
                    (*keys, "function"),
                    f"'{name}' beside a constant",
                    expected="none: a constant is one of a module or class",
                    remedy="leave it out; write a class's constant as `constant: PIController.GAIN`",
                )
            return ""
        if name is None:
            raise source.error(
                keys, "'function' is missing", expected="a qualified name such as Sensor.measure"
            )
        if not dotted_name(name.replace(".<locals>", "")):
            raise source.error(
                (*keys, "function"), f"'{name}'", expected="a qualified name such as Sensor.measure"
            )
        return name


def as_written_at(location: FaultLocation) -> dict[str, Any]:
    """The location as a spec writes it at `at`."""
    anchor = location.anchor
    found: dict[str, Any] = {"file": location.path}
    found |= {"function": location.function} if location.function else {}
    found[anchor.kind.value] = anchor.name if anchor.kind is not AnchorKind.ENTRY else True
    if anchor.which is not None:
        found["which"] = int(anchor.which) if anchor.which.isdecimal() else anchor.which
    return found | ({"nth": anchor.nth} if anchor.nth is not None else {})


def _fits(kind: AnchorKind, name: str) -> bool:
    """Whether an anchor of this kind can have the name."""
    if kind is AnchorKind.DEFAULT and "." in name:
        return False
    if kind in VALUE_ANCHORS:
        return is_expression(name)
    return dotted_name(name) or (kind in _ASSIGNMENTS and assignable(name))


def is_expression(text: str) -> bool:
    """Whether `text` is an expression of Python, without the probe."""
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except _NO_PYTHON:
        return False
    return not any(isinstance(node, ast.Name) and node.id == PROBE_NAME for node in ast.walk(tree))


def assignable(text: str) -> bool:
    """Whether `text` is something to assign to that has nothing to calculate: names, attributes, items by a
    constant or a name."""
    try:
        node: ast.expr = ast.parse(text, mode="eval").body
        ast.parse(f"({text})", mode="eval")  # a comment would swallow the bracket
    except _NO_PYTHON:
        return False
    whole = isinstance(node, ast.Name | ast.Attribute | ast.Subscript) and _is_chain(node)
    return whole and text.isprintable()  # so on one line


def base_name(text: str) -> str:
    """The first name of a chain."""
    return re.split(r"[.\[\s]", text, maxsplit=1)[0]


def _is_chain(node: ast.expr) -> bool:
    match node:
        case ast.Name(id=name):
            return name != PROBE_NAME
        case ast.Attribute(value=value):
            return _is_chain(value)
        case ast.Subscript(value=value, slice=index):
            return _is_chain(value) and (_is_constant(index) or _is_chain(index))
    return False


def _is_constant(node: ast.expr) -> bool:
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        node = node.operand
    return isinstance(node, ast.Constant) and isinstance(node.value, str | int)


def dotted_name(text: str) -> bool:
    """Whether `text` is a chain of identifiers that are no keywords and not the probe's name."""
    parts = text.split(".")
    return all(p.isidentifier() and not keyword.iskeyword(p) for p in parts) and parts[0] != PROBE_NAME
