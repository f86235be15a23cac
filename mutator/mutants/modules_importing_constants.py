"""Finds modules that import a constant by name, because the constant must be set there, too."""

import ast
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from symtable import symtable

from mutator.errors import MutatorError
from mutator.mutants.expression_roles import blocks_of
from mutator.mutants.name_scopes import globals_set_in_functions
from mutator.targets.source_tree import SourceTree

_STAR = "*"  # the name that `from module import *` imports, as `ast` gives it


@dataclass(frozen=True, slots=True, kw_only=True)
class _ImportedName:
    """`from module import name as local_name`, on a line (from 1)."""

    source_module: str
    name: str
    local_name: str
    line: int
    in_class: bool  # inside a class


@dataclass(frozen=True, slots=True, kw_only=True)
class _ModuleImports:
    path: str
    module: str
    imported_names: tuple[_ImportedName, ...]
    rebound_names: frozenset[str]
    exported_names: frozenset[str] | None = None  # the names in `__all__`, if they are literal strings


def dotted_names_importing_constant(tree: SourceTree, path: str, name: str) -> tuple[str, ...]:
    """Return `module.NAME` for each import of the constant `name` from the module at `path`.

    MutatorError if an import prevents setting the constant: a star import, an import into a class, or one in
    a module that also sets the name in another way.
    """
    files = [tree.derive_once(file, _module_imports) for file in tree.files if file.endswith(".py")]
    exported = {file.module: file.exported_names for file in files}
    names, refusals = [(module_name(path), name)], set[str]()
    for imported in names:  # grows during the loop: an imported name can be imported again
        for file in files:
            for imported_name in file.imported_names:
                if (imported_name.source_module, imported_name.name) not in (imported, (imported[0], _STAR)):
                    continue
                reason = _reason_import_prevents_setting(
                    imported_name, file, imported[1], exported.get(imported[0])
                )
                if reason:
                    refusals.add(f"{file.path}:{imported_name.line} {reason}")
                elif imported_name.name != _STAR and (file.module, imported_name.local_name) not in names:
                    names.append((file.module, imported_name.local_name))
    if refusals:
        raise MutatorError(
            f"the constant '{name}' cannot be set everywhere: {'; '.join(sorted(refusals))}",
            where=tree.root / path,
            expected="modules that import it by name and never assign to the name",
            remedy="anchor where the constant is used",
        )
    return tuple(".".join(module_and_name) for module_and_name in names[1:])


def _reason_import_prevents_setting(
    imported_name: _ImportedName, file: _ModuleImports, name: str, exported: frozenset[str] | None
) -> str | None:
    """Return why an import prevents setting the constant. `*` imports the `exported` names, if known."""
    if imported_name.name == _STAR:
        is_imported = not name.startswith("_") if exported is None else name in exported
        return "imports *" if is_imported else None
    if imported_name.in_class:
        return "imports it into a class"
    return (
        f"imports it, and also sets {imported_name.local_name} in another way"
        if imported_name.local_name in file.rebound_names
        else None
    )


def module_name(path: str) -> str:
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _module_imports(path: str, data: bytes, root: Path) -> _ModuleImports:
    try:
        tree, table = ast.parse(data), symtable(data, path, "exec")  # type: ignore[arg-type]  # as `compile`
    except (SyntaxError, ValueError, RecursionError):
        return _ModuleImports(
            path=path, module=module_name(path), imported_names=(), rebound_names=frozenset()
        )
    names = tuple(_imports_in_body(tree.body, path, in_class=False))
    count_by_name = Counter(imported_name.local_name for imported_name in names if not imported_name.in_class)
    assigned = {symbol.get_name() for symbol in table.get_symbols() if symbol.is_assigned()}
    repeated = {name for name, count in count_by_name.items() if count > 1}
    return _ModuleImports(
        path=path,
        module=module_name(path),
        imported_names=names,
        rebound_names=globals_set_in_functions(data) | assigned | repeated,
        exported_names=_names_in_dunder_all(tree),
    )


def _names_in_dunder_all(tree: ast.Module) -> frozenset[str] | None:
    """Return the names in `__all__` if it is assigned once, as a list or tuple of literal strings."""
    targets = [node for node in ast.walk(tree) if isinstance(node, ast.Name) and node.id == "__all__"]
    for node in tree.body:
        if (
            isinstance(node, ast.Assign)
            and node.targets == targets
            and isinstance(node.value, ast.List | ast.Tuple)
        ):
            texts = [element.value for element in node.value.elts if isinstance(element, ast.Constant)]
            return frozenset(map(str, texts)) if len(texts) == len(node.value.elts) else None
    return None


def _imports_in_body(body: Iterable[ast.stmt], path: str, *, in_class: bool) -> Iterator[_ImportedName]:
    """Yield the imports of a module and its classes, but not those in functions, which last for one call."""
    for statement in body:
        match statement:
            case ast.ImportFrom(module=module, names=names, level=level, lineno=line):
                source = ".".join(filter(None, (_relative_package(path, level), module)))
                for alias in names:
                    local_name = alias.asname or alias.name
                    yield _ImportedName(
                        source_module=source,
                        name=alias.name,
                        local_name=local_name,
                        line=line,
                        in_class=in_class,
                    )
            case ast.ClassDef(body=inner):
                yield from _imports_in_body(inner, path, in_class=True)
            case ast.FunctionDef() | ast.AsyncFunctionDef():
                pass
            case _:
                for block in blocks_of(statement):
                    yield from _imports_in_body(block, path, in_class=in_class)


def _relative_package(path: str, level: int) -> str:
    """Return the package where a relative import of this level starts; empty for an absolute one."""
    return ".".join(path.split("/")[:-level]) if level else ""
