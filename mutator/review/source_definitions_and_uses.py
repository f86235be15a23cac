"""The names in Python source: what a module defines and imports, and which names code uses."""

import ast
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

_FunctionNode = ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda
_FUNCTION_NODES = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)
SUPER = "super"
_COMPREHENSION_NODES = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)


class NodeSelection(Protocol):
    """Some nodes of a module."""

    def __contains__(self, node: ast.expr) -> bool: ...

    def may_contain(self, first_line: int, last_line: int) -> bool:
        """Return False if no node in these lines is selected, so that they need no search."""
        ...


class _AllNodes:
    def __contains__(self, node: ast.expr) -> bool:
        return True

    def may_contain(self, first_line: int, last_line: int) -> bool:
        return True


@dataclass(frozen=True, slots=True)
class SourceImport:
    """`from module import name`, or `import module` if `name` is None. `level` is the number of dots before
    the module.
    """

    module: str
    name: str | None = None
    level: int = 0

    def full_name(self, path: str) -> str:
        """Return the module's full name, for an import in the file at `path`."""
        if not self.level:
            return self.module
        parts = path.split("/")[: -self.level]
        return ".".join([*parts, *([self.module] if self.module else [])])


@dataclass(frozen=True, slots=True)
class NameUse:
    """A name that is not a local variable, with its attributes: `("effects", "Rain")`.

    `imported` is the import inside the function that binds the name, if any. For `self` and `super()`,
    `owner` is the class.
    """

    name_parts: tuple[str, ...]
    imported: SourceImport | None = None
    owning_class: str = ""


@dataclass(frozen=True)
class SourceModule:
    """A module's definitions (classes, functions, methods, constants) by qualified name, and its imports."""

    tree: ast.Module
    definitions: Mapping[str, Sequence[ast.stmt]]
    imports: Mapping[str, Sequence[SourceImport]]

    def definitions_of(self, name: str) -> Sequence[ast.stmt]:
        """Return the statements that define a name: several if it is assigned more than once."""
        return self.definitions.get(name, ())

    def has_name(self, name: str) -> bool:
        return name in self.definitions or name in self.imports

    def find_function(self, name: str) -> ast.stmt | None:
        """Return the function with that qualified name; the last if there are several."""
        nodes = self.definitions_of(name)
        return nodes[-1] if nodes else None

    def bases_of(self, name: str) -> list[tuple[str, ...]]:
        classes = [node for node in self.definitions_of(name) if isinstance(node, ast.ClassDef)]
        bases = (
            base.value if isinstance(base, ast.Subscript) else base
            for class_node in classes
            for base in class_node.bases
        )
        return [words for base in bases if (words := _dotted_name(base))]

    def source_of(self, name: str, data: bytes) -> bytes:
        """Return the lines of all statements that define a name, decorators included."""
        lines = data.splitlines(keepends=True)
        parts = []
        for node in self.definitions_of(name):
            parts += lines[_first_line(node) - 1 : node.end_lineno]
        return b"".join(parts)


def parse_module(path: str, data: bytes, root: Path) -> SourceModule:
    """Return the names in a file; empty if it is not Python."""
    try:
        tree = ast.parse(data)
    except (SyntaxError, ValueError, RecursionError):
        tree = ast.Module(body=[], type_ignores=[])
    defined: dict[str, list[ast.stmt]] = {}
    imports: dict[str, list[SourceImport]] = {}
    for name, node in _definitions_in(tree.body, ""):
        defined.setdefault(name, []).append(node)
    for name, import_ in _imports(tree.body):
        imports.setdefault(name, []).append(import_)
    return SourceModule(tree=tree, definitions=defined, imports=imports)


def external_names_used_in(
    node: ast.AST, owner: str = "", selection: NodeSelection | None = None
) -> Iterator[NameUse]:
    """Yield the external names used in the selected parts of `node`. `owner` is the class of a method."""
    yield from _external_uses(node, _NameScope(owner=owner), selection or _AllNodes())


def external_names_used_inside_function(
    function: ast.stmt | None, owner: str, node: ast.AST
) -> Iterator[NameUse]:
    """Yield the external names that `node` uses inside a function (a method, if `owner` is a class)."""
    scope = _NameScope(owner=owner)
    yield from _external_uses(
        node,
        scope.within_function(function) if isinstance(function, _FUNCTION_NODES) else scope,
        _AllNodes(),
    )


@dataclass(frozen=True, slots=True)
class _NameScope:
    """What names mean within a function: local variables, local imports, and `self`."""

    local_names: frozenset[str] = frozenset()
    imports: tuple[tuple[str, SourceImport], ...] = ()
    owner: str = ""
    self_name: str = ""  # the name of the method's first argument, such as `self`

    def within_function(self, node: _FunctionNode) -> "_NameScope":
        names, imports = _local_names_and_imports(node)
        method = bool(self.owner) and not self.local_names and not isinstance(node, ast.Lambda)
        arguments = [*node.args.posonlyargs, *node.args.args]
        return _NameScope(
            local_names=self.local_names | names,
            imports=(*self.imports, *imports),
            owner=self.owner,
            self_name=arguments[0].arg if method and arguments else self.self_name,
        )

    def find_use(self, words: tuple[str, ...]) -> NameUse | None:
        """Return the external use of a name with attributes; None for a local variable."""
        for name, import_ in reversed(self.imports):
            if name == words[0]:
                return NameUse(words, imported=import_)
        if words[0] == self.self_name and self.owner:
            return NameUse(words, owning_class=self.owner) if len(words) > 1 else None
        return None if words[0] in self.local_names else NameUse(words)


def _external_uses(node: ast.AST, scope: _NameScope, selection: NodeSelection) -> Iterator[NameUse]:
    if isinstance(node, ast.stmt) and not selection.may_contain(_first_line(node), node.end_lineno or 0):
        return
    if isinstance(node, ast.Name | ast.Attribute) and (words := _dotted_name(node)):
        if isinstance(node.ctx, ast.Load) and node in selection and (use := scope.find_use(words)):
            yield use
        return
    if isinstance(node, ast.Attribute) and _is_super_call(node.value) and scope.owner and node in selection:
        yield NameUse((SUPER, node.attr), owning_class=scope.owner)
    for part, inner in _children_with_scopes(node, scope):
        yield from _external_uses(part, inner, selection)


def _children_with_scopes(node: ast.AST, scope: _NameScope) -> Iterator[tuple[ast.AST, _NameScope]]:
    """Yield the parts of a node with their scopes, without annotations."""
    if isinstance(node, ast.ClassDef):
        inner = replace(scope, owner=f"{scope.owner}.{node.name}".strip("."), self_name="")
        yield from ((child, scope) for child in (*node.bases, *node.keywords, *node.decorator_list))
        yield from ((child, inner) for child in node.body)
    elif isinstance(node, _FUNCTION_NODES):
        defaults = (*node.args.defaults, *filter(None, node.args.kw_defaults))
        yield from ((child, scope) for child in (*defaults, *getattr(node, "decorator_list", ())))
        inner = scope.within_function(node)
        yield from ((child, inner) for child in (node.body if isinstance(node.body, list) else [node.body]))
    else:
        if isinstance(node, _COMPREHENSION_NODES):
            names = (
                n
                for generator in node.generators
                for n in ast.walk(generator.target)
                if isinstance(n, ast.Name)
            )
            scope = replace(scope, local_names=scope.local_names | {name.id for name in names})
        yield from ((child, scope) for child in _children_without_annotations(node))


def _children_without_annotations(node: ast.AST) -> Iterator[ast.AST]:
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield child


def _first_line(node: ast.stmt) -> int:
    """Return the statement's first line, decorators included."""
    decorators: list[ast.expr] = getattr(node, "decorator_list", [])
    return min([node.lineno, *(decorator.lineno for decorator in decorators)])


def _dotted_name(node: ast.AST) -> tuple[str, ...]:
    """`a.b.c` as a tuple of names; empty if the base is not a name."""
    words: list[str] = []
    while isinstance(node, ast.Attribute):
        words.append(node.attr)
        node = node.value
    return (node.id, *reversed(words)) if isinstance(node, ast.Name) else ()


def _is_super_call(node: ast.expr) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == SUPER


def _local_names_and_imports(node: _FunctionNode) -> tuple[frozenset[str], list[tuple[str, SourceImport]]]:
    arguments = node.args
    parameters = [
        *arguments.posonlyargs,
        *arguments.args,
        *arguments.kwonlyargs,
        arguments.vararg,
        arguments.kwarg,
    ]
    names = {parameter.arg for parameter in parameters if parameter}
    not_local: set[str] = set()
    imports: list[tuple[str, SourceImport]] = []
    pending: list[ast.AST] = list(node.body) if isinstance(node.body, list) else []
    while pending:
        visited = pending.pop()
        if isinstance(visited, ast.Import | ast.ImportFrom):
            imports += _imports([visited])
        elif isinstance(visited, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            names.add(visited.name)
        elif isinstance(visited, ast.Global | ast.Nonlocal):
            not_local |= set(visited.names)
        elif isinstance(visited, ast.Name) and isinstance(visited.ctx, ast.Store | ast.Del):
            names.add(visited.id)
        elif isinstance(visited, ast.ExceptHandler | ast.MatchAs | ast.MatchStar) and visited.name:
            names.add(visited.name)
        if isinstance(visited, ast.comprehension):
            pending += (visited.iter, *visited.ifs)  # a comprehension's variables are local to it
        elif not isinstance(visited, (*_FUNCTION_NODES, ast.ClassDef)):
            pending += ast.iter_child_nodes(visited)
    return frozenset(names - not_local - {name for name, _ in imports}), imports


def _definitions_in(body: Sequence[ast.stmt], inside: str) -> Iterator[tuple[str, ast.stmt]]:
    """Name and statement of every definition in a module or class, including those in blocks such as `if`."""
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield inside + node.name, node
            if isinstance(node, ast.ClassDef):
                yield from _definitions_in(node.body, f"{inside}{node.name}.")
        elif isinstance(node, ast.Assign | ast.AnnAssign | ast.AugAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = (n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name))
            yield from ((inside + name, node) for name in names)
        else:
            yield from _definitions_in(_nested_statements(node), inside)


def _imports(body: Sequence[ast.stmt]) -> Iterator[tuple[str, SourceImport]]:
    """Bound name and import for each import statement outside functions and classes."""
    for node in body:
        if isinstance(node, ast.Import):
            for alias in node.names:
                top = alias.name.partition(".")[0]
                yield (alias.asname, SourceImport(alias.name)) if alias.asname else (top, SourceImport(top))
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                name = None if alias.name == "*" else alias.name
                yield alias.asname or alias.name, SourceImport(node.module or "", name, node.level)
        elif not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield from _imports(_nested_statements(node))


def _nested_statements(node: ast.stmt) -> list[ast.stmt]:
    statements = [
        statement for name in ("body", "orelse", "finalbody") for statement in getattr(node, name, [])
    ]
    parts = [*getattr(node, "handlers", []), *getattr(node, "cases", [])]
    return statements + [statement for part in parts for statement in part.body]
