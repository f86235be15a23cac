"""What the source of a model may use. The check keeps honest mistakes out; it is no sandbox."""

import ast
import importlib
import types
from collections.abc import Iterator
from pathlib import Path

from mutator._common.message_text import shortened_repr
from mutator.errors import MutatorError

# a defence has no clock, file, process or shared random state
_ALLOWED_IMPORTS = frozenset(
    ("bisect", "cmath", "collections", "dataclasses", "enum", "fractions", "functools", "heapq", "itertools")
) | frozenset(("math", "numbers", "operator", "statistics", "typing"))
_REFUSED_NAMES = frozenset(
    ("breakpoint", "compile", "eval", "exec", "globals", "help", "input", "locals", "open", "print", "vars")
)
_REFUSED_MEMBERS = frozenset(("ForwardRef", "attrgetter", "get_type_hints", "methodcaller"))  # of modules
_FUNCTIONS_OF_NAMES = ("delattr", "getattr", "hasattr", "setattr")  # their second argument is a name
_SEVERAL_NAMES = "*"  # in an import; only public ones


def check_uses(tree: ast.Module, path: Path) -> None:
    """Check what a model imports and which names it uses.

    MutatorError for imports other than public functions, classes and constants of a few modules of the
    standard library, for functions that reach files or other code, and for names such as `__loader__`.
    """
    module_by_name: dict[str, types.ModuleType] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                module = _import_module(alias.name, node, path)
                root = alias.name.partition(".")[0]
                name = alias.asname or root
                module_by_name[name] = module if alias.asname else importlib.import_module(root)
        elif isinstance(node, ast.ImportFrom):
            module = _import_module("." * node.level + (node.module or ""), node, path)
            for alias in node.names:
                if alias.name != _SEVERAL_NAMES:
                    value = _public_value(module, alias.name, node, path)
                    if isinstance(value, types.ModuleType):
                        module_by_name[alias.asname or alias.name] = value
    _check_names(tree, path)
    _check_modules(tree, module_by_name, path)


def model_error(problem: str, path: Path, line: int | None, expected: str) -> MutatorError:
    """Return an error in the source of a model."""
    return MutatorError(problem, where=path, line=line, expected=expected, remedy="correct the model")


def _import_module(name: str, node: ast.stmt, path: Path) -> types.ModuleType:
    expected = f"imports of {', '.join(sorted(_ALLOWED_IMPORTS))}"
    error = model_error(f"an import of {name}", path, node.lineno, expected)
    if name.split(".")[0] not in _ALLOWED_IMPORTS:
        raise error
    try:
        return importlib.import_module(name)
    except ImportError:
        raise error from None


def _public_value(module: types.ModuleType, name: str, node: ast.stmt | ast.expr, path: Path) -> object:
    """Return what a module has under a name; MutatorError unless it is public and the module's own."""
    value = None if name.startswith("_") else getattr(module, name, None)
    is_other_module = isinstance(value, types.ModuleType) and not value.__name__.startswith(
        f"{module.__name__}."
    )
    if value is None or is_other_module:
        raise model_error(
            f"`{name}` of {module.__name__}",
            path,
            node.lineno,
            f"a public function, class or constant of {module.__name__}",
        )
    return value


def _check_modules(tree: ast.Module, module_by_name: dict[str, types.ModuleType], path: Path) -> None:
    """Check that modules are used only for what is public in them."""
    checked = set[ast.expr]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            owner = _module_of(node.value, module_by_name)
            if owner is not None:
                checked.add(node.value)
                if isinstance(_public_value(owner, node.attr, node, path), types.ModuleType):
                    continue
                checked.add(node)
    for node in ast.walk(tree):
        if isinstance(node, ast.Name | ast.Attribute) and node not in checked:
            module = _module_of(node, module_by_name)
            if module is not None:
                raise model_error(
                    f"the module {module.__name__} as a value",
                    path,
                    node.lineno,
                    f"something of it, such as `{ast.unparse(node)}.NAME`",
                )


def _module_of(node: ast.expr, module_by_name: dict[str, types.ModuleType]) -> types.ModuleType | None:
    """Return the module that a name, or an attribute of one, stands for."""
    if isinstance(node, ast.Name):
        return module_by_name.get(node.id)
    if isinstance(node, ast.Attribute) and (owner := _module_of(node.value, module_by_name)):
        value = getattr(owner, node.attr, None)
        return value if isinstance(value, types.ModuleType) else None
    return None


def _check_names(tree: ast.Module, path: Path) -> None:
    documentation = set(_documentation_nodes(tree))
    functions_with_constant_names = {
        node.func
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and len(node.args) > 1 and isinstance(node.args[1], ast.Constant)
    }
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name, ctx=ast.Load()):
                is_refused = name in _REFUSED_NAMES | _REFUSED_MEMBERS or _is_special(name)
                if name in _FUNCTIONS_OF_NAMES and node not in functions_with_constant_names:
                    expected = f'`{name}(VALUE, "NAME")`'
                    raise model_error(f"`{name}` with a computed name", path, node.lineno, expected)
            case ast.Attribute(attr=name) | ast.alias(name=name):
                is_refused = name in _REFUSED_MEMBERS or _is_special(name)
            case ast.MatchClass(kwd_attrs=names):
                name = next(filter(_is_special, names), "")
                is_refused = bool(name)
            case ast.Constant(value=str(text)) if "__" in text and node not in documentation:
                raise model_error(f"the text {shortened_repr(text)}", path, node.lineno, "no text with `__`")
            case _:
                continue
        if is_refused:
            raise model_error(f"the name `{name}`", path, node.lineno, "neither files nor other code")


def _is_special(name: str) -> bool:
    """Whether a name is one of Python's own, such as `__loader__`; calls of `__init__` are harmless."""
    return name.startswith("__") and name.endswith("__") and name != "__init__"


def _documentation_nodes(tree: ast.Module) -> Iterator[ast.AST]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and node.body:
            first = node.body[0]
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                yield first.value
