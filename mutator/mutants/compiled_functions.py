"""Finds functions that a compiler takes over: numba, JAX, PyTorch, TensorFlow and others.

Their Python code runs once, while it is compiled or traced, or never. A fault in it would end the run or stay
for good, so no place in it is offered.
"""

import ast
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from mutator.mutants.constant_imports import module_name
from mutator.mutants.expression_roles import blocks_of
from mutator.mutants.imported_names import ImportedNames
from mutator.targets.source_tree import SourceTree

# by compiler, with the environment variable that turns it off (None: nothing does)
_SWITCH_BY_COMPILER: Mapping[str, tuple[str, str] | None] = {
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
_TRACERS = frozenset({"casadi.Function", "jax.make_jaxpr", "torch.export.export", "torch.fx.symbolic_trace"})
_COMPILER_ROOTS = tuple(sorted({name.partition(".")[0].encode() for name in _SWITCH_BY_COMPILER}))
_ROOTS = tuple(sorted({*_COMPILER_ROOTS, *(name.partition(".")[0].encode() for name in _TRACERS)}))
# names of the parameter by which the compilers take a function
_FUNCTION_PARAMETERS = frozenset(
    {"fun", "func", "function", "py_func", "signature_or_function", "model", "obj"}
)
_Function = ast.FunctionDef | ast.AsyncFunctionDef
_STATEMENT_PARTS = (ast.stmt, ast.excepthandler, ast.match_case)


@dataclass(frozen=True, slots=True, kw_only=True)
class CompiledCode:
    """What a file gives to compilers. Functions are named by their qualified names, without `<locals>`."""

    compiler_by_function: Mapping[str, str]
    tracer_by_function: Mapping[str, str]  # functions that a call such as `casadi.Function(...)` runs once
    compiler_by_foreign_function: Mapping[str, str]  # functions of other modules, by dotted name
    frozen_constants: Mapping[str, str]  # constants that only compiled functions read, with the compiler


_NOTHING = CompiledCode(
    compiler_by_function={}, tracer_by_function={}, compiler_by_foreign_function={}, frozen_constants={}
)


def compiler_of_function(tree: SourceTree, path: str, function: str, env: Mapping[str, str]) -> str | None:
    """Return the compiler that takes over a function, unless `env` (of the manifest) turns it off."""
    functions = {**_compiled_elsewhere(tree, path), **compiled_code(tree, path).compiler_by_function}
    compiler = next((c for name, c in functions.items() if _is_within(function, name)), None)
    return None if compiler is None or _is_turned_off(compiler, env) else compiler


def compiler_of_constant(tree: SourceTree, path: str, name: str, env: Mapping[str, str]) -> str | None:
    """Return the compiler whose functions alone read a constant of the module: they keep its first value.

    A constant that another file imports, or an attribute of its name, can be read there, too.
    """
    compiler = compiled_code(tree, path).frozen_constants.get(name)
    if compiler is None or _is_turned_off(compiler, env):
        return None
    others = (other for other in tree.files if other != path and other.endswith(".py"))
    is_read_elsewhere = any(
        name in names or "*" in names
        for names in (tree.derive_once(other, _foreign_names) for other in others)
    )
    return None if is_read_elsewhere else compiler


def switch_of_compiler(compiler: str) -> str:
    """Return `NAME: 'value'`, which in a manifest's `env` turns a compiler off; empty if nothing does."""
    switch = _SWITCH_BY_COMPILER[compiler]
    return f"{switch[0]}: '{switch[1]}'" if switch else ""


def tracer_of_function(tree: SourceTree, path: str, function: str) -> str | None:
    """Return the call that runs a function once to build a graph, such as `casadi.Function`."""
    tracers = compiled_code(tree, path).tracer_by_function
    return next((tracer for name, tracer in tracers.items() if _is_within(function, name)), None)


def compiled_code(tree: SourceTree, path: str) -> CompiledCode:
    return tree.derive_once(path, _find_compiled_code)


def _is_turned_off(compiler: str, env: Mapping[str, str]) -> bool:
    switch = _SWITCH_BY_COMPILER[compiler]
    return switch is not None and env.get(switch[0]) == switch[1]


def _is_within(function: str, outer: str) -> bool:
    return function == outer or function.startswith(f"{outer}.")


def _foreign_names(path: str, data: bytes, root: Path) -> frozenset[str]:
    """Return the names that a file imports from modules, or reads as attributes; `*` is all of a module."""
    try:
        module = ast.parse(data)
    except (SyntaxError, ValueError, RecursionError):
        return frozenset()
    names = set[str]()
    for node in ast.walk(module):
        match node:
            case ast.ImportFrom(names=aliases):
                names.update(alias.name for alias in aliases)
            case ast.Attribute(attr=name):
                names.add(name)
    return frozenset(names)


def _compiled_elsewhere(tree: SourceTree, path: str) -> dict[str, str]:
    """Return the functions of this file that other files compile: `fast = njit(law)`, after an import."""
    prefix, functions = f"{module_name(path)}.", dict[str, str]()
    for other, compiler_by_function in tree.derive_once_from_all(_compiled_across_files).items():
        if other != path:
            for dotted, compiler in compiler_by_function.items():
                # the root of the target need not be the folder on `sys.path`
                if f".{prefix}".endswith(f".{dotted.rpartition('.')[0]}."):
                    functions[dotted.rpartition(".")[2]] = compiler
    return functions


def _compiled_across_files(tree: SourceTree) -> dict[str, Mapping[str, str]]:
    """Return, by file, the functions of other modules that it compiles; files without any are left out."""
    paths = [p for p, data in tree.files.items() if p.endswith(".py") and _can_import(data, _COMPILER_ROOTS)]
    functions = {path: compiled_code(tree, path).compiler_by_foreign_function for path in paths}
    return {path: compilers for path, compilers in functions.items() if compilers}


def _can_import(data: bytes, roots: tuple[bytes, ...]) -> bool:
    """Whether a source text can import one of the packages; most need only the search for words."""
    return any(root in data for root in roots) and _import_pattern(roots).search(data) is not None


@cache
def _import_pattern(roots: tuple[bytes, ...]) -> re.Pattern[bytes]:
    line = rb"(?:\\\r?\n|[^\n#;])*?"  # the rest of a line, which goes on after a backslash
    return re.compile(
        rb"(?:(?:\A(?:\xef\xbb\xbf)?|[\r\n;:])[ \t\f]*import\b" + line + rb"|\bfrom[\s\\.]*)"
        rb"\b(?:" + b"|".join(roots) + rb")\b"
    )


def _find_compiled_code(path: str, data: bytes, root: Path) -> CompiledCode:
    if not _can_import(data, _ROOTS):
        return _NOTHING
    try:
        module = ast.parse(data)
    except (SyntaxError, ValueError, RecursionError):
        return _NOTHING
    return _CompilerSearch(module, path).result()


class _CompilerSearch:
    def __init__(self, module: ast.Module, path: str) -> None:
        self._module = module
        self._imports = ImportedNames(module, path)
        self._functions: dict[str, list[_Function]] = {}
        _collect_functions(module.body, "", self._functions)
        self._compilers: dict[str, str] = {}
        self._tracers: dict[str, str] = {}
        self._foreign: dict[str, str] = {}

    def result(self) -> CompiledCode:
        self._visit_body(self._module.body, "", None)
        return CompiledCode(
            compiler_by_function=self._compilers,
            tracer_by_function=self._tracers,
            compiler_by_foreign_function=self._foreign,
            frozen_constants=self._frozen_constants(),
        )

    def _compiler(self, node: ast.expr) -> str | None:
        name = self._imports.dotted_callable(node)
        return name if name in _SWITCH_BY_COMPILER else None

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
                if not isinstance(node, _STATEMENT_PARTS):
                    self._visit_calls(node, prefix)
            for block in blocks_of(statement):
                self._visit_body(block, inner_prefix, inner_compiler)

    def _visit_calls(self, part: ast.AST, prefix: str) -> None:
        for call in (node for node in ast.walk(part) if isinstance(node, ast.Call)):
            if compiler := self._compiler(call.func):
                for argument in self._functions_given_to(call):
                    self._note_function(argument, prefix, compiler, self._compilers)
                    if dotted := self._imports.dotted(argument):
                        self._foreign[dotted] = compiler
            elif (tracer := self._imports.dotted(call.func)) in _TRACERS:
                for node in (n for argument in (*call.args, *call.keywords) for n in ast.walk(argument)):
                    traced = node.func if isinstance(node, ast.Call) else node
                    self._note_function(traced, prefix, tracer, self._tracers)

    def _functions_given_to(self, call: ast.Call) -> Iterator[ast.expr]:
        """Yield what a compiler is given: `law`, also by keyword or inside another call (`vmap(law)`)."""
        by_keyword = [keyword.value for keyword in call.keywords if keyword.arg in _FUNCTION_PARAMETERS]
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

    def _frozen_constants(self) -> dict[str, str]:
        inside = Counter[str]()
        compilers: dict[str, str] = {}
        for function, compiler in self._compilers.items():
            for node in self._functions.get(function, ()):
                names = list(_names_read_in(node))
                inside.update(names)
                compilers |= dict.fromkeys(names, compiler)
        everywhere = Counter(_names_read_in(self._module))
        return {name: compiler for name, compiler in compilers.items() if inside[name] >= everywhere[name]}


def _collect_functions(body: Sequence[ast.stmt], prefix: str, functions: dict[str, list[_Function]]) -> None:
    for statement in body:
        inner_prefix = prefix
        if isinstance(statement, _Function | ast.ClassDef):
            inner_prefix = f"{prefix}{statement.name}."
        if isinstance(statement, _Function):
            functions.setdefault(inner_prefix[:-1], []).append(statement)
        for block in blocks_of(statement):
            _collect_functions(block, inner_prefix, functions)


def _names_read_in(node: ast.AST) -> Iterator[str]:
    for part in ast.walk(node):
        if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Load):
            yield part.id
