"""Refuses places where injected lines would call a variable of the target instead of a built-in function.

The lines of `offset`, for example, call `max`. In a function with a variable of that name, they would fail
or do something else as soon as the fault is active.
"""

import ast
import builtins
import re
from collections.abc import Sequence
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
    if hidden := called & hidden_builtins_at(file, line):
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


def hidden_builtins_at(file: ParsedFile, line: int) -> frozenset[str]:
    """Return the built-in functions for which a file has others of the same name around a line (from 0)."""
    return _hidden_in_module(file.data).union(
        *(names for lines, names in _hidden_in_functions(file.syntax_tree) if line in lines)
    )


# both are asked for each place of a file, and for each of its mutants
@lru_cache(maxsize=16)
def _hidden_in_module(data: bytes) -> frozenset[str]:
    return names_of_module(data) & _BUILTIN_FUNCTIONS


@lru_cache(maxsize=16)
def _hidden_in_functions(tree: ast.Module) -> tuple[tuple[range, frozenset[str]], ...]:
    """Return the lines (from 0) of each function that binds names of built-in functions, with these names."""
    return tuple(
        (range(node.lineno - 1, node.end_lineno or 0), names)
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and (names := _BUILTIN_FUNCTIONS & _names_bound_in_function(node))
    )


def _names_bound_in_function(function: ast.FunctionDef | ast.AsyncFunctionDef) -> frozenset[str]:
    """Return the names that a function binds, possibly in a function or class inside it, and parameters."""
    parts = (function.args, *function.body)
    parameters = (node.arg for part in parts for node in ast.walk(part) if isinstance(node, ast.arg))
    return frozenset(parameters).union(*map(bound_names, parts))
