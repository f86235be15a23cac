"""Refuses places where injected lines would call a variable of the target instead of a built-in function.

The lines of `offset`, for example, call `max`. In a function with a variable of that name, they would fail
or do something else as soon as the fault is active.
"""

import ast
import builtins
import re
from collections.abc import Iterator, Sequence
from functools import lru_cache

from jinja2 import Environment, nodes

from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModel
from mutator.mutants.name_scopes import bound_names, names_of_module
from mutator.mutants.parsed_files_and_anchors import ParsedFile

_TEMPLATE_TAG_PATTERN = re.compile(r"\{\{.*?\}\}|\{%.*?%\}|\{#.*?#\}", re.DOTALL)
_WORD_PATTERN = re.compile(r"\w+")
_CALL_PATTERN = re.compile(r"(?<![\w.])(\w+)\(")
_BUILTIN_FUNCTIONS = frozenset(name for name in dir(builtins) if callable(getattr(builtins, name)))
_BUILTINS_CALLED_FOR_NUMBERS = frozenset({"float"})  # infinity and NaN as values of parameters


def check_calls_builtins(file: ParsedFile, line: int, model: FaultModel, code: str) -> None:
    """Refuse code for a place in `line` (from 0) if its template calls a built-in function whose name means
    something else there: MutatorError.
    """
    names = {
        name for name in _called_by_templates(model.template, model.expression_template or "") if name in code
    }
    called = names & _called_names(code) if names else names
    if called and (hidden := called.intersection(_names_bound_around(file, line))):
        name = min(hidden)
        raise MutatorError(
            f"the injected code calls Python's `{name}`, but the file has another `{name}` here",
            where=file.full_path,
            line=line + 1,
            expected=f"a place where `{name}` is the built-in function",
            remedy=f"inject in another function, or use a model or parameters without `{name}`",
        )


@lru_cache(maxsize=256)
def _called_by_templates(*templates: str) -> frozenset[str]:
    """Return the built-in functions that a model's templates can call."""
    texts = [_TEMPLATE_TAG_PATTERN.sub(" ", template) for template in templates]
    words = {word for text in texts for word in _WORD_PATTERN.findall(text)}
    return _BUILTIN_FUNCTIONS & (words | _BUILTINS_CALLED_FOR_NUMBERS)


def _called_names(code: str) -> frozenset[str]:
    return frozenset(
        node.func.id
        for node in ast.walk(ast.parse(code))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    )


@lru_cache(maxsize=256)
def builtins_always_called(template: str) -> frozenset[str]:
    """Return the built-in functions that a template calls with any parameters."""
    return frozenset(_always_called(Environment().parse(template).body))


def _always_called(parts: Sequence[nodes.Node]) -> set[str]:
    names = set[str]()
    for part in parts:
        match part:
            case nodes.If():
                branches = [part.body, *(branch.body for branch in part.elif_), part.else_]
                names |= set.intersection(*map(_always_called, branches))
            case nodes.Output():
                texts = (text.data for text in part.nodes if isinstance(text, nodes.TemplateData))
                names |= {name for text in texts for name in _CALL_PATTERN.findall(text)} & _BUILTIN_FUNCTIONS
    return names


class HiddenBuiltins:
    """Says of which built-in functions a file has other ones of the same name around a line."""

    def __init__(self, file: ParsedFile) -> None:
        self._file = file
        everywhere = {*names_of_module(file.data), *_names_bound_in(file.syntax_tree)}
        self._bound_somewhere = everywhere & _BUILTIN_FUNCTIONS

    def hides_any_at(self, names: frozenset[str], line: int) -> bool:
        """Whether one of `names`, in injected code at a line (from 0), would not be the built-in function."""
        names &= self._bound_somewhere
        return bool(names) and not names.isdisjoint(_names_bound_around(self._file, line))


def _names_bound_around(file: ParsedFile, line: int) -> Iterator[str]:
    """Yield the names that the module and the functions around a line bind."""
    yield from names_of_module(file.data)
    for node in ast.walk(file.syntax_tree):
        match node:
            case ast.FunctionDef() | ast.AsyncFunctionDef() if _spans_line(node, line + 1):
                yield from (name for part in (node.args, *node.body) for name in _names_bound_in(part))


def _spans_line(node: ast.stmt, line: int) -> bool:
    return node.lineno <= line <= (node.end_lineno or 0)


def _names_bound_in(part: ast.AST) -> Iterator[str]:
    """Yield the names that a part binds, possibly in a function or class inside it, and parameters."""
    yield from bound_names(part)
    yield from (node.arg for node in ast.walk(part) if isinstance(node, ast.arg))
