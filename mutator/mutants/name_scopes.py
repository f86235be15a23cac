"""Finds out whether names in functions are local, nonlocal or global, from the compiler's symbol tables.

An assignment makes a name local to the whole function, even if the assignment never runs.
"""

import ast
import unicodedata
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from symtable import Symbol, SymbolTable, symtable

UsedNamesByFunction = Mapping[tuple[int, str], frozenset[str]]


@dataclass(frozen=True, slots=True, kw_only=True)
class RescopedName:
    """A name whose meaning has changed in a function, a class or, since Python 3.14, an annotation."""

    name: str
    function_or_class: str
    scope_before: str
    scope_after: str


def used_names_by_function(data: bytes) -> UsedNamesByFunction:
    """Return the names that each function knows and uses, by the function's line (from 1) and name."""
    return dict(_used_names_by_function_in(_symbol_table(data), ""))


def _used_names_by_function_in(
    table: SymbolTable, private_prefix: str
) -> Iterator[tuple[tuple[int, str], frozenset[str]]]:
    """Like `used_names_by_function`; `private_prefix` is what the compiler adds to `__x` in a class."""
    if table.get_type() == "class":
        name = table.get_name().lstrip("_")
        private_prefix = f"_{name}__" if name else ""
    names = set(table.get_identifiers())
    if table.get_type() == "function" and ".0" not in names:  # a comprehension's argument
        names |= {
            name[len(private_prefix) - 2 :]
            for name in names
            if private_prefix and name.startswith(private_prefix)
        }
        yield (table.get_lineno(), table.get_name()), frozenset(names)
    for child in table.get_children():
        yield from _used_names_by_function_in(child, private_prefix)


def globals_set_in_functions(data: bytes) -> frozenset[str]:
    """Return a module's names that functions or classes bind after declaring them `global`."""
    return frozenset(
        symbol.get_name()
        for table in _nested_tables(_symbol_table(data))
        for symbol in table.get_symbols()
        if symbol.is_declared_global() and (symbol.is_assigned() or symbol.is_imported())
    )


def names_of_module(data: bytes) -> frozenset[str]:
    """Return the names that a module has as globals: bound in it, or in functions that declare them."""
    symbols = _cached_symbol_table(data).get_symbols()
    bound = (s.get_name() for s in symbols if s.is_assigned() or s.is_imported() or s.is_namespace())
    return globals_set_in_functions(data).union(bound)


def bound_names(tree: ast.AST) -> Iterator[str]:
    """Yield the names that code binds or deletes, including those inside comprehensions and functions, but no
    parameters.
    """
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name, ctx=ast.Store() | ast.Del()):
                yield name
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                yield name
            case ast.alias(name=name, asname=other):
                yield other or name.partition(".")[0]
            case ast.ExceptHandler(name=str(name)) | ast.MatchAs(name=str(name)):
                yield name
            case ast.MatchStar(name=str(name)) | ast.MatchMapping(rest=str(name)):
                yield name


def _nested_tables(table: SymbolTable) -> Iterator[SymbolTable]:
    for child in table.get_children():
        yield child
        yield from _nested_tables(child)


def normalize_identifier(name: str) -> str:
    """Normalize an identifier as the compiler does. For example, the two code points for `µ` become one."""
    return unicodedata.normalize("NFKC", name)


def rescoped_names(before: bytes, after: bytes, inserted_lines: Container[int]) -> Iterator[RescopedName]:
    """Yield the names whose meaning changes with the inserted lines.

    `inserted_lines` are the numbers of these lines in `after`, from 1. SyntaxError if `after` is not valid.
    """
    return _rescoped_between(_cached_symbol_table(before), _symbol_table(after), inserted_lines)


def _rescoped_between(
    before: SymbolTable, after: SymbolTable, inserted_lines: Container[int]
) -> Iterator[RescopedName]:
    homes = {symbol.get_name(): _scope_kind(symbol) for symbol in after.get_symbols()}
    for symbol in before.get_symbols():
        name, home = symbol.get_name(), _scope_kind(symbol)
        if homes.get(name, "unknown") != home:
            yield RescopedName(
                name=name,
                function_or_class=_scope_name(before),
                scope_before=home,
                scope_after=homes.get(name, "unknown"),
            )
    unchanged = [child for child in _scopes_in(after) if child.get_lineno() not in inserted_lines]
    for child_before, child_after in zip(_scopes_in(before), unchanged, strict=False):
        yield from _rescoped_between(child_before, child_after, inserted_lines)


def _scopes_in(table: SymbolTable) -> list[SymbolTable]:
    """Return the functions, classes and annotations in a scope.

    Since Python 3.14, annotations have scopes, too. Those without names are left out: they cannot change,
    and an inserted line can add one.
    """
    return [child for child in table.get_children() if child.get_type() != "annotation" or _has_names(child)]


def _has_names(annotations: SymbolTable) -> bool:
    return any(not symbol.is_parameter() for symbol in annotations.get_symbols())


def _scope_name(table: SymbolTable) -> str:
    if table.get_type() == "annotation":
        return f"the annotations of line {table.get_lineno()}"
    return table.get_name()


def _scope_kind(symbol: Symbol) -> str:
    if symbol.is_local():
        return "local"
    return "nonlocal" if symbol.is_free() else "global or built-in"


def _symbol_table(data: bytes) -> SymbolTable:
    return symtable(data, "<source>", "exec")  # type: ignore[arg-type]  # bytes, as `compile`


# a fault changes few files, but each of its mutants compares them again
_cached_symbol_table = lru_cache(maxsize=16)(_symbol_table)
