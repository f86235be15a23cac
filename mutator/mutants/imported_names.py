"""Resolves names of a module to what they import: `njit` to `numba.njit`, also under another name."""

import ast
import builtins
from collections.abc import Collection, Iterator, Mapping, Sequence
from importlib.util import find_spec

from mutator.mutants.expression_roles import blocks_of

_PARTIAL = "functools.partial"
_STAR = "*"
_CAUGHT_WITHOUT_PACKAGE = frozenset({"ImportError", "ModuleNotFoundError", "Exception", "BaseException"})
_ImportNode = ast.Import | ast.ImportFrom


class ImportedNames:
    """The imports of a module, and its own names for imported functions (`fast = njit(cache=True)`)."""

    def __init__(self, module: ast.Module, path: str, packages: Collection[str]) -> None:
        """Read the imports. `packages` are those that matter: of these, `*` can import any name, and what is
        not installed is not imported, if the module catches the ImportError.
        """
        imports = _imports(module, path, packages)
        self._dotted_by_name: dict[str, str] = {name: dotted for name, dotted in imports if name != _STAR}
        stars = [dotted.rpartition(".")[0] for name, dotted in imports if name == _STAR]
        self._star = next((star for star in stars if star.partition(".")[0] in packages), "")
        self._defined_names = {*dir(builtins), *(_names_defined_in(module) if self._star else ())}
        for name, value in _assignments(module.body):
            if name not in self._dotted_by_name and (dotted := self.dotted_callable(value)):
                self._dotted_by_name[name] = dotted

    @property
    def dotted_by_name(self) -> Mapping[str, str]:
        return self._dotted_by_name

    def dotted(self, node: ast.expr) -> str:
        """Return the dotted name that an expression imports; empty if it is no imported name."""
        match node:
            case ast.Name(id=name):
                is_from_star = self._star and name not in self._defined_names
                return self._dotted_by_name.get(name, f"{self._star}.{name}" if is_from_star else "")
            case ast.Attribute(value=value, attr=name):
                return f"{owner}.{name}" if (owner := self.dotted(value)) else ""
        return ""

    def dotted_callable(self, node: ast.expr) -> str:
        """Like `dotted`, also for a call that sets options: `njit(cache=True)`, `partial(jit, ...)`."""
        if isinstance(node, ast.Call):
            name = self.dotted_callable(node.func)
            return self.dotted_callable(node.args[0]) if name == _PARTIAL and node.args else name
        return self.dotted(node)


def _assignments(body: Sequence[ast.stmt]) -> Iterator[tuple[str, ast.expr]]:
    """Yield name and value of the assignments to single names outside functions and classes."""
    for statement in body:
        match statement:
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                yield name, value
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                pass
            case _:
                for block in blocks_of(statement):
                    yield from _assignments(block)


def _names_defined_in(module: ast.Module) -> Iterator[str]:
    for node in ast.walk(module):
        match node:
            case ast.Name(id=name, ctx=ast.Store()) | ast.arg(arg=name):
                yield name
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                yield name


def _imports(module: ast.Module, path: str, packages: Collection[str]) -> list[tuple[str, str]]:
    """Return local and dotted name of each import, also those in functions and `try` blocks."""
    names, without_effect = list[tuple[str, str]](), set(_imports_without_effect(module, packages))
    for node in ast.walk(module):
        match node:
            case _ if node in without_effect:
                pass
            case ast.Import(names=aliases):
                for alias in aliases:
                    first = alias.name.partition(".")[0]
                    names.append((alias.asname, alias.name) if alias.asname else (first, first))
            case ast.ImportFrom(module=source, names=aliases, level=level):
                package = ".".join(path.split("/")[:-level]) if level else ""
                origin = ".".join(filter(None, (package, source)))
                names += [(alias.asname or alias.name, f"{origin}.{alias.name}") for alias in aliases]
    return names


def _imports_without_effect(module: ast.Module, packages: Collection[str]) -> Iterator[_ImportNode]:
    """Yield the imports of a package that is not installed, where a handler goes on without it; if the
    package is installed, the imports of that handler.
    """
    for node in ast.walk(module):
        if isinstance(node, ast.Try) and any(map(_catches_import_error, node.handlers)):
            tried = list(_imports_in(node.body))
            tried_packages = {name for part in tried for name in _packages_of(part) if name in packages}
            if any(find_spec(package) is None for package in tried_packages):
                yield from (*tried, *_imports_in(node.orelse))
            elif tried_packages:
                yield from _imports_in(node.handlers)


def _catches_import_error(handler: ast.ExceptHandler) -> bool:
    types = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type]
    return any(kind is None or ast.unparse(kind) in _CAUGHT_WITHOUT_PACKAGE for kind in types)


def _imports_in(nodes: Sequence[ast.AST]) -> Iterator[_ImportNode]:
    return (part for node in nodes for part in ast.walk(node) if isinstance(part, _ImportNode))


def _packages_of(node: _ImportNode) -> list[str]:
    if isinstance(node, ast.Import):
        return [alias.name.partition(".")[0] for alias in node.names]
    return [] if node.level else [(node.module or "").partition(".")[0]]
