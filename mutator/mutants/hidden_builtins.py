"""Refuses places where injected lines would call a variable of the target instead of a built-in function.

The lines of `offset`, for example, call `max`. In a function with a variable of that name, they would fail
or do something else as soon as the fault is active.
"""

import ast
import builtins
import re
from collections.abc import Iterator
from functools import lru_cache

from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModel
from mutator.mutants.anchors import ParsedFile
from mutator.mutants.name_scopes import names_of_module

_TEMPLATE_TAG_PATTERN = re.compile(r"\{\{.*?\}\}|\{%.*?%\}|\{#.*?#\}", re.DOTALL)
_WORD_PATTERN = re.compile(r"\w+")
_BUILTIN_FUNCTIONS = frozenset(name for name in dir(builtins) if callable(getattr(builtins, name)))
_CALLED_FOR_NUMBERS = frozenset({"float"})  # infinity and NaN as values of parameters


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
    return _BUILTIN_FUNCTIONS & (words | _CALLED_FOR_NUMBERS)


def _called_names(code: str) -> frozenset[str]:
    return frozenset(
        node.func.id
        for node in ast.walk(ast.parse(code))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    )


def _names_bound_around(file: ParsedFile, line: int) -> Iterator[str]:
    """Yield the names that the module and the functions around a line bind."""
    yield from names_of_module(file.data)
    for node in ast.walk(file.tree):
        match node:
            case ast.FunctionDef() | ast.AsyncFunctionDef() if _has_line(node, line + 1):
                yield from _names_bound_in(node)


def _has_line(node: ast.stmt, line: int) -> bool:
    return node.lineno <= line <= (node.end_lineno or 0)


def _names_bound_in(function: ast.FunctionDef | ast.AsyncFunctionDef) -> Iterator[str]:
    """Yield the names that a function binds, possibly in a function or class inside it."""
    for node in ast.walk(function):
        match node:
            case ast.Name(id=name, ctx=ast.Store() | ast.Del()) | ast.arg(arg=name):
                yield name
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                if node is not function:
                    yield name
            case ast.alias(name=name, asname=other):
                yield other or name.partition(".")[0]
            case ast.ExceptHandler(name=str(name)) | ast.MatchAs(name=str(name)):
                yield name
            case ast.MatchStar(name=str(name)) | ast.MatchMapping(rest=str(name)):
                yield name
