"""Finds fixed values: constants of modules and classes, and defaults of parameters.

Python computes them once, when it loads the module, before any fault is active. So the probe sets them while
the fault is active, and restores them afterwards. A tagged line after the statement tells the probe where
the values are.
"""

import ast
from codecs import BOM_UTF8
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mutator._common.message_text import spelling_suggestion
from mutator.errors import MutatorError
from mutator.model import AnchorKind, FaultLocation
from mutator.mutants.expression_roles import blocks_of
from mutator.mutants.logical_lines import LogicalLines
from mutator.mutants.name_scopes import globals_set_in_functions, normalize_identifier

_READ_ONLY_BASE_CLASS_ENDINGS = ("Enum", "Flag", "NamedTuple", "TypedDict")  # endings of base class names
_Function = ast.FunctionDef | ast.AsyncFunctionDef
_EnclosingClasses = tuple[ast.ClassDef, ...]  # enclosing classes, from the outermost
_OwningStatement = ast.stmt | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantOrDefault:
    """A constant or a default, on lines `first_line` to `end_line` (from 0, the last exclusive)."""

    kind: AnchorKind
    function: str
    name: str  # `LIMIT`, `Class.LIMIT` or a parameter of `function`
    first_line: int
    end_line: int
    insertion_line: int  # the tagged line is inserted before this line, indented by `indent`
    indent: bytes
    dotted_path: str  # dotted path from the module, in the compiler's spelling
    unsettable_reason: str | None = None  # why the value cannot be set


def list_constants_and_defaults(
    data: bytes, tree: ast.Module, logical_lines: LogicalLines
) -> tuple[ConstantOrDefault, ...]:
    """Return all fixed values of a file, in source order.

    If a constant is assigned several times, the last assignment is used.
    """
    owned_values: dict[tuple[AnchorKind, str, str], tuple[ConstantOrDefault, _OwningStatement]] = {}
    for value, owner in _ConstantAndDefaultFinder(data, logical_lines).values_in_body(tree.body, ()):
        key = (value.kind, value.function, value.name)
        _, earlier_owner = owned_values.pop(key, (None, owner))
        if earlier_owner is not owner:
            what = "functions" if value.kind is AnchorKind.DEFAULT else "classes"
            value = replace(value, unsettable_reason=f"several {what} have the same name")
        owned_values[key] = value, owner
    rebound = globals_set_in_functions(data)
    return tuple(
        replace(value, unsettable_reason="a function also sets it")
        if value.kind is AnchorKind.CONSTANT and value.dotted_path in rebound
        else value
        for value, _ in owned_values.values()
    )


def parameters_with_default(arguments: ast.arguments) -> Iterator[tuple[str, ast.expr]]:
    """Yield the parameters that have a default, each with its default."""
    places = [*arguments.posonlyargs, *arguments.args]
    with_default = places[len(places) - len(arguments.defaults) :]
    for argument, value in zip(with_default, arguments.defaults, strict=True):
        yield argument.arg, value
    for argument, keyword in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True):
        if keyword is not None:
            yield argument.arg, keyword


class _ConstantAndDefaultFinder:
    """Walks the bodies of a module and its classes, and yields each value with its class or function."""

    def __init__(self, data: bytes, logical_lines: LogicalLines) -> None:
        self.lines = data.splitlines(keepends=True)
        self.logical_lines = logical_lines

    def values_in_body(
        self,
        body: Sequence[ast.stmt],
        enclosing_classes: _EnclosingClasses,
        enclosing_statement: ast.stmt | None = None,
    ) -> Iterator[tuple[ConstantOrDefault, _OwningStatement]]:
        for statement in body:
            outermost_statement = enclosing_statement or statement
            match statement:
                case ast.ClassDef():
                    yield from self.values_in_body(statement.body, (*enclosing_classes, statement))
                case ast.FunctionDef() | ast.AsyncFunctionDef():
                    yield from self.defaults(statement, enclosing_classes, outermost_statement)
                case ast.Assign(targets=targets, value=value):
                    yield from self.constants(targets, value, enclosing_classes, outermost_statement)
                case (
                    ast.AnnAssign(target=target, value=ast.expr() as value)
                    | ast.AugAssign(target=target, value=value)
                ):
                    yield from self.constants([target], value, enclosing_classes, outermost_statement)
                case _:
                    for block in blocks_of(statement):
                        yield from self.values_in_body(block, enclosing_classes, outermost_statement)

    def constants(
        self,
        targets: Iterable[ast.expr],
        value: ast.expr,
        enclosing_classes: _EnclosingClasses,
        outermost_statement: ast.stmt,
    ) -> Iterator[tuple[ConstantOrDefault, _OwningStatement]]:
        for name in (name for target in targets for name in _assigned_names(target)):
            index, indent = self.insertion_point(outermost_statement)
            yield (
                ConstantOrDefault(
                    kind=AnchorKind.CONSTANT,
                    function="",
                    name=".".join((*_class_names(enclosing_classes), name)),
                    first_line=value.lineno - 1,
                    end_line=value.end_lineno or 0,
                    insertion_line=index,
                    indent=indent,
                    dotted_path=_dotted_path(enclosing_classes, name),
                    unsettable_reason=_unsettable_reason(enclosing_classes[-1], value)
                    if enclosing_classes
                    else None,
                ),
                enclosing_classes[-1] if enclosing_classes else None,
            )

    def defaults(
        self, function: _Function, enclosing_classes: _EnclosingClasses, outermost_statement: ast.stmt
    ) -> Iterator[tuple[ConstantOrDefault, _OwningStatement]]:
        for name, value in parameters_with_default(function.args):
            index, indent = self.insertion_point(outermost_statement)
            yield (
                ConstantOrDefault(
                    kind=AnchorKind.DEFAULT,
                    function=".".join((*_class_names(enclosing_classes), function.name)),
                    name=name,
                    first_line=value.lineno - 1,
                    end_line=value.end_lineno or 0,
                    insertion_line=index,
                    indent=indent,
                    dotted_path=_dotted_path(enclosing_classes, function.name, name),
                ),
                function,
            )

    def insertion_point(self, outermost_statement: ast.stmt) -> tuple[int, bytes]:
        first = min(
            node.lineno for node in (outermost_statement, *getattr(outermost_statement, "decorator_list", ()))
        )
        line = self.lines[self.logical_lines.start_of(first - 1)].removeprefix(BOM_UTF8)
        end = self.logical_lines.end_of((outermost_statement.end_lineno or first) - 1)
        return end, line[: len(line) - len(line.lstrip(b" \t\f"))]


def _assigned_names(target: ast.expr) -> Iterator[str]:
    match target:
        case ast.Name(id=name):
            yield name
        case ast.Tuple(elts=elements) | ast.List(elts=elements):
            for element in elements:
                yield from _assigned_names(element)
        case ast.Starred(value=value):
            yield from _assigned_names(value)


def _class_names(enclosing_classes: _EnclosingClasses) -> Iterator[str]:
    return (node.name for node in enclosing_classes)


def _dotted_path(enclosing_classes: _EnclosingClasses, *names: str) -> str:
    """Return the dotted path from the module, with private names spelled as the compiler spells them."""
    path, private = list[str](), ""
    for name in (*_class_names(enclosing_classes), *names):
        hidden = private and name.startswith("__") and not name.endswith("__")
        path.append(f"_{private}{name}" if hidden else name)
        if len(path) <= len(enclosing_classes):
            private = name.lstrip("_")
    return ".".join(path)


def _unsettable_reason(owner: ast.ClassDef, value: ast.expr) -> str | None:
    for base in owner.bases:
        name = ast.unparse(base)
        if name.endswith(_READ_ONLY_BASE_CLASS_ENDINGS):
            return f"its class derives from {name}, which does not allow a new value"
    if isinstance(value, ast.Call) and ast.unparse(value.func).endswith("field"):
        keywords = {keyword.arg for keyword in value.keywords}
        if "default_factory" in keywords or not ({"default", None} & keywords or value.args):
            return "the field has no default that is computed once"
    return None


def choose_constant_or_default(
    values: Sequence[ConstantOrDefault], location: FaultLocation, where: Path
) -> ConstantOrDefault:
    """Return the constant or default that the location names.

    MutatorError with candidates if there is none, or if it cannot be set.
    """
    kind, name = location.anchor.kind, normalize_identifier(location.anchor.name)
    function = normalize_identifier(location.function)
    alike = [value for value in values if value.kind is kind and value.function == function]
    match = next((value for value in alike if value.name == name), None)
    what = f"{kind.value} '{location.anchor.name}'" + (
        f" in {location.function}" if location.function else ""
    )
    if match is None:
        names = [value.name for value in alike if not value.unsettable_reason]
        raise MutatorError(
            f"no {what}",
            where=where,
            expected=f"one of {', '.join(names)}"
            if names
            else "another kind of anchor: there is none of this kind",
            remedy="write the name exactly as in the source" + spelling_suggestion(name, names),
        )
    if match.unsettable_reason:
        raise MutatorError(
            f"the {what} cannot be set: {match.unsettable_reason}",
            where=where,
            line=match.first_line + 1,
            expected="a value that is computed once, when the module is loaded",
            remedy="anchor where the value is used",
        )
    return match
