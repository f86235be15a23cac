"""The names in Python source: what a module defines and imports, and which names code uses."""

import ast
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

_Function = ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda
_SCOPES = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)
_Wanted = Callable[[ast.expr], bool]
SUPER = "super"
_COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)


@dataclass(frozen=True, slots=True)
class Import:
    """`from module import name`, or `import module` if `name` is None. `level` is the number of dots before
    the module.
    """

    module: str
    name: str | None = None
    level: int = 0

    def absolute(self, path: str) -> str:
        """Return the module's full name, for an import in the file at `path`."""
        if not self.level:
            return self.module
        parts = path.split("/")[: -self.level]
        return ".".join([*parts, *([self.module] if self.module else [])])


@dataclass(frozen=True, slots=True)
class Use:
    """A name that is not a local variable, with its attributes: `("effects", "Rain")`.

    `imported` is the import inside the function that binds the name, if any. For `self` and `super()`,
    `owner` is the class.
    """

    words: tuple[str, ...]
    imported: Import | None = None
    owner: str = ""


@dataclass(frozen=True)
class Module:
    """A module's definitions (classes, functions, methods, constants) by qualified name, and its imports."""

    tree: ast.Module
    defined: Mapping[str, Sequence[ast.stmt]]
    imports: Mapping[str, Sequence[Import]]

    def nodes_of(self, name: str) -> Sequence[ast.stmt]:
        """Return the statements that define a name: several if it is assigned more than once."""
        return self.defined.get(name, ())

    def knows(self, name: str) -> bool:
        return name in self.defined or name in self.imports

    def function(self, name: str) -> ast.stmt | None:
        """Return the function with that qualified name; the last if there are several."""
        found = self.nodes_of(name)
        return found[-1] if found else None

    def bases_of(self, name: str) -> list[tuple[str, ...]]:
        classes = [node for node in self.nodes_of(name) if isinstance(node, ast.ClassDef)]
        bases = (
            base.value if isinstance(base, ast.Subscript) else base for one in classes for base in one.bases
        )
        return [words for base in bases if (words := _dotted(base))]

    def source_of(self, name: str, data: bytes) -> bytes:
        """Return the lines of all statements that define a name, decorators included."""
        lines = data.splitlines(keepends=True)
        parts = []
        for node in self.nodes_of(name):
            decorators = getattr(node, "decorator_list", [])
            first = min(one.lineno for one in (node, *decorators))
            parts += lines[first - 1 : node.end_lineno]
        return b"".join(parts)


def read_module(path: str, data: bytes, root: Path) -> Module:
    """Return the names in a file; empty if it is not Python."""
    try:
        tree = ast.parse(data)
    except (SyntaxError, ValueError, RecursionError):
        tree = ast.Module(body=[], type_ignores=[])
    defined: dict[str, list[ast.stmt]] = {}
    imports: dict[str, list[Import]] = {}
    for name, node in _definitions(tree.body, ""):
        defined.setdefault(name, []).append(node)
    for name, one in _imports(tree.body):
        imports.setdefault(name, []).append(one)
    return Module(tree=tree, defined=defined, imports=imports)


def uses_in(node: ast.AST, owner: str = "", wanted: _Wanted | None = None) -> Iterator[Use]:
    """Yield the external names used in `node`, within the parts that `wanted` accepts. `owner` is the class
    of a method.
    """
    yield from _uses(node, _Scope(owner=owner), wanted or (lambda _: True))


def uses_beside(function: ast.stmt | None, owner: str, node: ast.AST) -> Iterator[Use]:
    """Yield the external names that `node` uses inside a function (a method, if `owner` is a class)."""
    scope = _Scope(owner=owner)
    yield from _uses(node, scope.inside(function) if isinstance(function, _SCOPES) else scope, lambda _: True)


@dataclass(frozen=True, slots=True)
class _Scope:
    """What names mean within a function: local variables, local imports, and `self`."""

    local: frozenset[str] = frozenset()
    imports: tuple[tuple[str, Import], ...] = ()
    owner: str = ""
    me: str = ""  # the name of the method's first argument, such as `self`

    def inside(self, node: _Function) -> "_Scope":
        names, imports = _bound(node)
        method = bool(self.owner) and not self.local and not isinstance(node, ast.Lambda)
        arguments = [*node.args.posonlyargs, *node.args.args]
        return _Scope(
            local=self.local | names,
            imports=(*self.imports, *imports),
            owner=self.owner,
            me=arguments[0].arg if method and arguments else self.me,
        )

    def use(self, words: tuple[str, ...]) -> Use | None:
        """Return the external use of a name with attributes; None for a local variable."""
        for name, one in reversed(self.imports):
            if name == words[0]:
                return Use(words, imported=one)
        if words[0] == self.me and self.owner:
            return Use(words, owner=self.owner) if len(words) > 1 else None
        return None if words[0] in self.local else Use(words)


def _uses(node: ast.AST, scope: _Scope, wanted: _Wanted) -> Iterator[Use]:
    if isinstance(node, ast.Name | ast.Attribute) and (words := _dotted(node)):
        if isinstance(node.ctx, ast.Load) and wanted(node) and (use := scope.use(words)):
            yield use
        return
    if isinstance(node, ast.Attribute) and _is_super(node.value) and scope.owner and wanted(node):
        yield Use((SUPER, node.attr), owner=scope.owner)
    for part, inner in _parts(node, scope):
        yield from _uses(part, inner, wanted)


def _parts(node: ast.AST, scope: _Scope) -> Iterator[tuple[ast.AST, _Scope]]:
    """Yield the parts of a node with their scopes, without annotations."""
    if isinstance(node, ast.ClassDef):
        inner = replace(scope, owner=f"{scope.owner}.{node.name}".strip("."), me="")
        yield from ((one, scope) for one in (*node.bases, *node.keywords, *node.decorator_list))
        yield from ((one, inner) for one in node.body)
    elif isinstance(node, _SCOPES):
        defaults = (*node.args.defaults, *filter(None, node.args.kw_defaults))
        yield from ((one, scope) for one in (*defaults, *getattr(node, "decorator_list", ())))
        inner = scope.inside(node)
        yield from ((one, inner) for one in (node.body if isinstance(node.body, list) else [node.body]))
    else:
        if isinstance(node, _COMPREHENSIONS):
            names = (n for one in node.generators for n in ast.walk(one.target) if isinstance(n, ast.Name))
            scope = replace(scope, local=scope.local | {name.id for name in names})
        yield from ((one, scope) for one in _called_children(node))


def _called_children(node: ast.AST) -> Iterator[ast.AST]:
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns"):
            continue
        for one in value if isinstance(value, list) else [value]:
            if isinstance(one, ast.AST):
                yield one


def _dotted(node: ast.AST) -> tuple[str, ...]:
    """`a.b.c` as a tuple of names; empty if the base is not a name."""
    words: list[str] = []
    while isinstance(node, ast.Attribute):
        words.append(node.attr)
        node = node.value
    return (node.id, *reversed(words)) if isinstance(node, ast.Name) else ()


def _is_super(node: ast.expr) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == SUPER


def _bound(node: _Function) -> tuple[frozenset[str], list[tuple[str, Import]]]:
    arguments = node.args
    every = [
        *arguments.posonlyargs,
        *arguments.args,
        *arguments.kwonlyargs,
        arguments.vararg,
        arguments.kwarg,
    ]
    names = {one.arg for one in every if one}
    outside: set[str] = set()
    imports: list[tuple[str, Import]] = []
    waiting: list[ast.AST] = list(node.body) if isinstance(node.body, list) else []
    while waiting:
        one = waiting.pop()
        if isinstance(one, ast.Import | ast.ImportFrom):
            imports += _imports([one])
        elif isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            names.add(one.name)
        elif isinstance(one, ast.Global | ast.Nonlocal):
            outside |= set(one.names)
        elif isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store | ast.Del):
            names.add(one.id)
        elif isinstance(one, ast.ExceptHandler | ast.MatchAs | ast.MatchStar) and one.name:
            names.add(one.name)
        if isinstance(one, ast.comprehension):
            waiting += (one.iter, *one.ifs)  # a comprehension's variables are local to it
        elif not isinstance(one, (*_SCOPES, ast.ClassDef)):
            waiting += ast.iter_child_nodes(one)
    return frozenset(names - outside - {name for name, _ in imports}), imports


def _definitions(body: Sequence[ast.stmt], inside: str) -> Iterator[tuple[str, ast.stmt]]:
    """Name and statement of every definition in a module or class, including those in blocks such as `if`."""
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield inside + node.name, node
            if isinstance(node, ast.ClassDef):
                yield from _definitions(node.body, f"{inside}{node.name}.")
        elif isinstance(node, ast.Assign | ast.AnnAssign | ast.AugAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = (n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name))
            yield from ((inside + name, node) for name in names)
        else:
            yield from _definitions(_blocks(node), inside)


def _imports(body: Sequence[ast.stmt]) -> Iterator[tuple[str, Import]]:
    """Bound name and import for each import statement outside functions and classes."""
    for node in body:
        if isinstance(node, ast.Import):
            for alias in node.names:
                top = alias.name.partition(".")[0]
                yield (alias.asname, Import(alias.name)) if alias.asname else (top, Import(top))
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                name = None if alias.name == "*" else alias.name
                yield alias.asname or alias.name, Import(node.module or "", name, node.level)
        elif not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield from _imports(_blocks(node))


def _blocks(node: ast.stmt) -> list[ast.stmt]:
    found = [one for name in ("body", "orelse", "finalbody") for one in getattr(node, name, [])]
    parts = [*getattr(node, "handlers", []), *getattr(node, "cases", [])]
    return found + [one for part in parts for one in part.body]
