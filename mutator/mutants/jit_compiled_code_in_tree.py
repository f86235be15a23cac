"""Finds functions that a compiler takes over: numba, JAX, PyTorch, TensorFlow and others.

Their Python code runs once, while it is compiled or traced, or never. A fault in it would end the run or stay
for good, so no place in it is offered.
"""

import ast
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from mutator.mutants.jit_compiled_code_in_file import (
    COMPILER_PACKAGES,
    SWITCH_BY_COMPILER,
    CompiledCode,
    can_import,
    find_compiled_code,
)
from mutator.mutants.modules_importing_constants import module_name
from mutator.targets.source_tree import SourceTree


def jit_compiler_of_function(
    tree: SourceTree, path: str, function: str, env: Mapping[str, str]
) -> str | None:
    """Return the compiler that takes over a function, unless `env` (of the manifest) turns it off."""
    functions = {**_compiled_elsewhere(tree, path), **compiled_code(tree, path).compiler_by_function}
    compiler = next((c for name, c in functions.items() if _is_within(function, name)), None)
    compiler = compiler or _compiler_of_callee(tree, path, function)
    return None if compiler is None or _is_turned_off(compiler, env) else compiler


def _compiler_of_callee(tree: SourceTree, path: str, function: str) -> str | None:
    """Return the compiler whose functions alone call a function, in this file or in others."""
    callees = dict(_compiled_callees_within_file(tree, path))
    for name, compiler in _called_elsewhere(tree, path).items():
        if name not in tree.derive_once(path, _variables_read) and not _is_read_elsewhere(tree, path, name):
            callees[name] = compiler
    return next((compiler for name, compiler in callees.items() if _is_within(function, name)), None)


def _compiled_callees_within_file(tree: SourceTree, path: str) -> Mapping[str, str]:
    """Return the functions that the file calls only in compiled functions; none if another file can call one
    of them, because that one can call the others.
    """
    callees = compiled_code(tree, path).compiler_by_callee
    return {} if any(_is_read_elsewhere(tree, path, name) for name in _last_names(callees)) else callees


def jit_compiler_freezing_constant(
    tree: SourceTree, path: str, name: str, env: Mapping[str, str]
) -> str | None:
    """Return the compiler whose functions alone read a constant of the module: they keep its first value.

    A constant that another file imports, or an attribute of its name, can be read there, too.
    """
    code = compiled_code(tree, path)
    compiler = code.compiler_by_frozen_constant.get(name)
    if compiler is None and all(
        _compiler_of_callee(tree, path, callee) for callee in code.compiler_by_callee
    ):
        compiler = code.compiler_by_constant_of_callees.get(name)
    is_free = compiler is None or _is_turned_off(compiler, env) or _is_read_elsewhere(tree, path, name)
    return None if is_free else compiler


def environment_switch_of_compiler(compiler: str) -> str:
    """Return `NAME: 'value'`, which in a manifest's `env` turns a compiler off; empty if nothing does."""
    switch = SWITCH_BY_COMPILER[compiler]
    return f"{switch[0]}: '{switch[1]}'" if switch else ""


def tracing_call_of_function(tree: SourceTree, path: str, function: str) -> str | None:
    """Return the call that runs a function once to build a graph, such as `casadi.Function`."""
    tracers = compiled_code(tree, path).tracer_by_function
    return next((tracer for name, tracer in tracers.items() if _is_within(function, name)), None)


def compiled_code(tree: SourceTree, path: str) -> CompiledCode:
    return tree.derive_once(path, find_compiled_code)


def _is_turned_off(compiler: str, env: Mapping[str, str]) -> bool:
    switch = SWITCH_BY_COMPILER[compiler]
    return switch is not None and env.get(switch[0]) == switch[1]


def _is_within(function: str, outer: str) -> bool:
    return function == outer or function.startswith(f"{outer}.")


def _is_read_elsewhere(tree: SourceTree, path: str, name: str) -> bool:
    """Whether Python reads a name of a file in another one; what only compiled functions read is left out."""
    for other in tree.files:
        if other != path and other.endswith(".py"):
            names = tree.derive_once(other, _imported_and_attribute_names)
            if "*" in names or (name in names and name not in _last_names(_compiled_callees_of(tree, other))):
                return True
    return False


def _imported_and_attribute_names(path: str, data: bytes, root: Path) -> frozenset[str]:
    """Return the names that a file imports from modules, or reads as attributes; `*` is all of a module."""
    names = set[str]()
    for node in _syntax_nodes(data):
        match node:
            case ast.ImportFrom(names=aliases):
                names.update(alias.name for alias in aliases)
            case ast.Attribute(attr=name):
                names.add(name)
    return frozenset(names)


def _variables_read(path: str, data: bytes, root: Path) -> frozenset[str]:
    return frozenset(
        n.id for n in _syntax_nodes(data) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)
    )


def _syntax_nodes(data: bytes) -> Iterator[ast.AST]:
    try:
        return ast.walk(ast.parse(data))
    except (SyntaxError, ValueError, RecursionError):
        return iter(())


def _last_names(dotted_names: Iterable[str]) -> set[str]:
    return {dotted.rpartition(".")[2] for dotted in dotted_names}


def _compiled_callees_of(tree: SourceTree, path: str) -> Mapping[str, str]:
    return compiled_code(tree, path).compiler_by_foreign_callee


def _compiled_elsewhere(tree: SourceTree, path: str) -> dict[str, str]:
    """Return the functions of this file that other files compile: `fast = njit(law)`, after an import."""
    return _functions_defined_in(path, tree.derive_once_from_all(_compiled_across_files))


def _called_elsewhere(tree: SourceTree, path: str) -> dict[str, str]:
    """Return the functions of this file that other files call in compiled functions, and only there."""
    return _functions_defined_in(path, tree.derive_once_from_all(_called_across_files))


def _functions_defined_in(path: str, compilers_by_file: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """Return those of the functions, by file and dotted name, that the file at `path` defines."""
    prefix, functions = f"{module_name(path)}.", dict[str, str]()
    for other, compiler_by_function in compilers_by_file.items():
        if other != path:
            for dotted, compiler in compiler_by_function.items():
                # the root of the target need not be the folder on `sys.path`
                if f".{prefix}".endswith(f".{dotted.rpartition('.')[0]}."):
                    functions[dotted.rpartition(".")[2]] = compiler
    return functions


def _compiled_across_files(tree: SourceTree) -> dict[str, Mapping[str, str]]:
    """Return, by file, the functions of other modules that it compiles; files without any are left out."""
    functions = {
        path: compiled_code(tree, path).compiler_by_foreign_function for path in _files_with_compilers(tree)
    }
    return {path: compilers for path, compilers in functions.items() if compilers}


def _called_across_files(tree: SourceTree) -> dict[str, Mapping[str, str]]:
    """Like `_compiled_across_files`, for what it calls only in compiled functions."""
    functions = {path: _compiled_callees_of(tree, path) for path in _files_with_compilers(tree)}
    return {path: compilers for path, compilers in functions.items() if compilers}


def _files_with_compilers(tree: SourceTree) -> Iterator[str]:
    return (p for p, data in tree.files.items() if p.endswith(".py") and can_import(data, COMPILER_PACKAGES))
