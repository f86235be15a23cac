"""Finds what one file gives to compilers (numba, JAX, PyTorch, TensorFlow and others) or has traced.

A function is compiled if a decorator or a call gives it to a compiler, or if only compiled functions call it.
"""

import ast
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TypeGuard

from mutator.mutants.expression_roles import blocks_of
from mutator.mutants.imported_names import ImportedNames

# by compiler, with the environment variable that turns it off (None: nothing does)
SWITCH_BY_COMPILER: Mapping[str, tuple[str, str] | None] = {
    **dict.fromkeys(("numba.jit", "numba.njit", "numba.generated_jit"), ("NUMBA_DISABLE_JIT", "1")),
    **dict.fromkeys(("numba.experimental.jitclass", "numba.jitclass"), ("NUMBA_DISABLE_JIT", "1")),
    **dict.fromkeys(("numba.vectorize", "numba.guvectorize", "numba.cfunc", "numba.stencil")),
    **dict.fromkeys(("numba.cuda.jit", "numba.extending.overload", "numba.extending.overload_method")),
    "numba.extending.register_jitable": ("NUMBA_DISABLE_JIT", "1"),
    **dict.fromkeys(("jax.jit", "jax.pmap", "equinox.filter_jit", "flax.nnx.jit"), ("JAX_DISABLE_JIT", "1")),
    "torch.compile": ("TORCH_COMPILE_DISABLE", "1"),
    **dict.fromkeys(("torch.jit.script", "torch.jit.trace", "torch.jit.script_method"), ("PYTORCH_JIT", "0")),
    **dict.fromkeys(("tensorflow.function", "taichi.kernel", "taichi.func", "triton.jit", "cupy.fuse")),
    **dict.fromkeys(("warp.kernel", "warp.func", "transonic.boost", "transonic.jit", "codon.jit")),
    "cython.compile": None,
}
# calls that run a function once, with symbols instead of numbers, to build a graph
_TRACING_CALLS = frozenset(
    {"casadi.Function", "jax.make_jaxpr", "torch.export.export", "torch.fx.symbolic_trace"}
)
COMPILER_PACKAGES = tuple(sorted({name.partition(".")[0].encode() for name in SWITCH_BY_COMPILER}))
_SEARCHED_PACKAGES = tuple(
    sorted({*COMPILER_PACKAGES, *(name.partition(".")[0].encode() for name in _TRACING_CALLS)})
)
_PACKAGE_NAMES = frozenset(package.decode() for package in _SEARCHED_PACKAGES)
# names of the parameter by which the compilers take a function
_PARAMETERS_TAKING_FUNCTION = frozenset(
    {"fun", "func", "function", "py_func", "signature_or_function", "model", "obj"}
)
_Function = ast.FunctionDef | ast.AsyncFunctionDef
_STATEMENT_NODE_TYPES = (ast.stmt, ast.excepthandler, ast.match_case)


@dataclass(frozen=True, slots=True, kw_only=True)
class CompiledCode:
    """What a file gives to compilers. Functions are named by their qualified names, without `<locals>`."""

    compiler_by_function: Mapping[str, str]
    tracer_by_function: Mapping[str, str]  # functions that a call such as `casadi.Function(...)` runs once
    compiler_by_callee: Mapping[str, str]  # functions that this file calls only in compiled functions
    compiler_by_foreign_function: Mapping[str, str]  # functions of other modules, by dotted name
    compiler_by_foreign_callee: Mapping[str, str]  # the same that this file calls only in compiled functions
    compiler_by_frozen_constant: Mapping[
        str, str
    ]  # constants that only compiled functions read, with the compiler
    compiler_by_constant_of_callees: Mapping[str, str]  # the same if callees count as compiled


_NO_COMPILED_CODE = CompiledCode(
    compiler_by_function={},
    tracer_by_function={},
    compiler_by_callee={},
    compiler_by_foreign_function={},
    compiler_by_foreign_callee={},
    compiler_by_frozen_constant={},
    compiler_by_constant_of_callees={},
)


def can_import(data: bytes, packages: tuple[bytes, ...]) -> bool:
    """Whether a source text can import one of the packages; most need only the search for words."""
    return any(package in data for package in packages) and _import_pattern(packages).search(data) is not None


@cache
def _import_pattern(packages: tuple[bytes, ...]) -> re.Pattern[bytes]:
    line = rb"(?:\\\r?\n|[^\n#;])*?"  # the rest of a line, which goes on after a backslash
    return re.compile(
        rb"(?:(?:\A(?:\xef\xbb\xbf)?|[\r\n;:])[ \t\f]*import\b" + line + rb"|\bfrom[\s\\.]*)"
        rb"\b(?:" + b"|".join(packages) + rb")\b"
    )


def find_compiled_code(path: str, data: bytes, root: Path) -> CompiledCode:
    if not can_import(data, _SEARCHED_PACKAGES):
        return _NO_COMPILED_CODE
    try:
        module = ast.parse(data)
    except (SyntaxError, ValueError, RecursionError):
        return _NO_COMPILED_CODE
    return _CompilerSearch(module, path).result()


class _CompilerSearch:
    def __init__(self, module: ast.Module, path: str) -> None:
        self._module = module
        self._imports = ImportedNames(module, path, _PACKAGE_NAMES)
        self._functions: dict[str, list[_Function]] = {}
        _collect_functions(module.body, "", self._functions)
        self._compilers: dict[str, str] = {}
        self._tracers: dict[str, str] = {}
        self._foreign: dict[str, str] = {}
        self._lambdas: list[tuple[ast.expr, str]] = []  # given to compilers, with the compiler

    def result(self) -> CompiledCode:
        self._visit_body(self._module.body, "", None)
        callees = self._callees()
        compiled, outside = self._split_nodes(callees)
        names_outside = {self._imports.dotted(node) for node in outside if isinstance(node, ast.expr)}
        return CompiledCode(
            compiler_by_function=self._compilers,
            tracer_by_function=self._tracers,
            compiler_by_callee=callees,
            compiler_by_foreign_function=self._foreign,
            compiler_by_foreign_callee={
                dotted: compiler
                for node, compiler in compiled.items()
                if isinstance(node, ast.expr) and (dotted := self._imports.dotted(node)) not in names_outside
            },
            compiler_by_frozen_constant=self._frozen_constants({}),
            compiler_by_constant_of_callees=self._frozen_constants(callees),
        )

    def _callees(self) -> dict[str, str]:
        """Return the functions of this file that are read in compiled functions, and nowhere else."""
        callees: dict[str, str] = {}
        while len(more := self._functions_read_in(self._split_nodes(callees)[0])) > len(callees):
            callees = more
        before = None
        while callees != before:
            before, outside = callees, _names_read_in(self._split_nodes(callees)[1])
            callees = {name: c for name, c in callees.items() if name.rpartition(".")[2] not in outside}
        return callees

    def _functions_read_in(self, nodes: Mapping[ast.AST, str]) -> dict[str, str]:
        functions: dict[str, str] = {}
        for node, compiler in nodes.items():
            match node:
                case ast.Name(id=name) | ast.Attribute(value=ast.Name(id="self" | "cls"), attr=name):
                    names = (f for f in self._functions if f.rpartition(".")[2] == name)
                    functions.update((f, compiler) for f in names if f not in self._compilers)
        return functions

    def _split_nodes(self, callees: Mapping[str, str]) -> tuple[dict[ast.AST, str], list[ast.AST]]:
        """Return the nodes of compiled functions and of `callees`, with the compiler, and all others."""
        bodies = [
            (node, compiler)
            for function, compiler in (*self._compilers.items(), *callees.items())
            for node in self._functions.get(function, ())
        ]
        inside = {part: compiler for node, compiler in (*bodies, *self._lambdas) for part in ast.walk(node)}
        return inside, [node for node in ast.walk(self._module) if node not in inside]

    def _frozen_constants(self, callees: Mapping[str, str]) -> dict[str, str]:
        compiled, outside = self._split_nodes(callees)
        variables_outside = {node.id for node in outside if _is_variable_read(node)}
        return {
            node.id: compiler
            for node, compiler in compiled.items()
            if _is_variable_read(node) and node.id not in variables_outside
        }

    def _compiler(self, node: ast.expr) -> str | None:
        name = self._imports.dotted_callable(node)
        return name if name in SWITCH_BY_COMPILER else None

    def _visit_body(self, body: Sequence[ast.stmt], prefix: str, class_compiler: str | None) -> None:
        for statement in body:
            inner_prefix, inner_compiler = prefix, class_compiler
            if isinstance(statement, _Function | ast.ClassDef):
                inner_prefix = f"{prefix}{statement.name}."
                compilers = [class_compiler, *map(self._compiler, statement.decorator_list)]
                inner_compiler = next(filter(None, compilers), None)
                if inner_compiler and isinstance(statement, _Function):
                    self._compilers.setdefault(inner_prefix[:-1], inner_compiler)
            for node in ast.iter_child_nodes(statement):
                if not isinstance(node, _STATEMENT_NODE_TYPES):
                    self._visit_calls(node, prefix)
            for block in blocks_of(statement):
                self._visit_body(block, inner_prefix, inner_compiler)

    def _visit_calls(self, part: ast.AST, prefix: str) -> None:
        for call in (node for node in ast.walk(part) if isinstance(node, ast.Call)):
            if compiler := self._compiler(call.func):
                for argument in self._functions_given_to(call):
                    self._note_function(argument, prefix, compiler, self._compilers)
                    if isinstance(argument, ast.Lambda):
                        self._lambdas.append((argument, compiler))
                    if dotted := self._imports.dotted(argument):
                        self._foreign[dotted] = compiler
            elif (tracer := self._imports.dotted(call.func)) in _TRACING_CALLS:
                for node in (n for argument in (*call.args, *call.keywords) for n in ast.walk(argument)):
                    traced = node.func if isinstance(node, ast.Call) else node
                    self._note_function(traced, prefix, tracer, self._tracers)

    def _functions_given_to(self, call: ast.Call) -> Iterator[ast.expr]:
        """Yield what a compiler is given: `law`, also by keyword or inside another call (`vmap(law)`)."""
        by_keyword = [
            keyword.value for keyword in call.keywords if keyword.arg in _PARAMETERS_TAKING_FUNCTION
        ]
        for argument in call.args[:1] or by_keyword:
            yield argument
            if isinstance(argument, ast.Call) and self._imports.dotted(argument.func):
                yield from self._functions_given_to(argument)

    def _note_function(self, node: ast.AST, prefix: str, what: str, functions: dict[str, str]) -> None:
        """Note the function of this file that an expression names: `law`, `self.law`, `Net()` of PyTorch."""
        scopes = prefix.split(".")[:-1]
        match node:
            case ast.Name(id=name):
                names = [".".join([*scopes[:n], name]) for n in range(len(scopes), -1, -1)]
            case ast.Attribute(value=ast.Name(), attr=name):
                names = [".".join([*scopes[:n], name]) for n in range(len(scopes) - 1, 0, -1)]
            case ast.Call(func=ast.Name(id=name)):
                names = [f"{name}.forward"]
            case _:
                return
        if function := next((name for name in names if name in self._functions), None):
            functions.setdefault(function, what)


def _collect_functions(body: Sequence[ast.stmt], prefix: str, functions: dict[str, list[_Function]]) -> None:
    for statement in body:
        inner_prefix = prefix
        if isinstance(statement, _Function | ast.ClassDef):
            inner_prefix = f"{prefix}{statement.name}."
        if isinstance(statement, _Function):
            functions.setdefault(inner_prefix[:-1], []).append(statement)
        for block in blocks_of(statement):
            _collect_functions(block, inner_prefix, functions)


def _names_read_in(nodes: Collection[ast.AST]) -> set[str]:
    """Return the names of variables that are read, and of attributes."""
    variables = {node.id for node in nodes if _is_variable_read(node)}
    return variables | {node.attr for node in nodes if isinstance(node, ast.Attribute)}


def _is_variable_read(node: ast.AST) -> TypeGuard[ast.Name]:
    return isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)
