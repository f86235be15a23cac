"""Finds, by name, the target code that injected lines call, so that reviewers can see it.

Names are resolved through imports, transitively, to functions, classes and constants of the tree. Classes are
included whole, with their bases; for a call on `self`, only the called method is. Calls that depend on values
(a method of an argument, say) are not followed. Annotations are ignored.
"""

import ast
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from mutator.config.location_syntax import PROBE_NAME
from mutator.mutants.injected_lines import changed_value_positions, tag_of
from mutator.review import source_names
from mutator.review.source_names import SUPER, Import, Module, Use, uses_in
from mutator.targets.source_tree import SourceTree

_Class = tuple[str, str]  # its file, its name
_FURTHEST = 20  # maximum number of imports to follow for a name


@dataclass(frozen=True, slots=True, order=True)
class _Place:
    """A piece of the source tree: `name` in the file at `path`, or the whole file (no name). For a method,
    `me` is the class of the object on which it is called.
    """

    path: str
    name: str
    me: _Class | None = None


class CalledCode:
    def __init__(self, tree: SourceTree) -> None:
        self._tree = tree

    def of_lines(self, path: str, data: bytes) -> dict[str, str]:
        """Return the code that the injected lines of a mutated file call: the source of each place, such as
        `car/weather.py Rain`. `data` is the content of the file at `path`. Files other than Python are
        included whole.
        """
        module = source_names.read_module(path, data, Path())
        return self._closure(path, uses_in(module.tree, wanted=_injected(data)))

    def of_expressions(self, path: str, function: str, texts: Iterable[str]) -> dict[str, str]:
        """Return the code that expressions would call in a function. Invalid expressions are ignored."""
        node, owner = self._module(path).function(function), function.rpartition(".")[0]
        found: list[Use] = []
        for text in texts:
            with suppress(SyntaxError):
                found += source_names.uses_beside(node, owner, ast.parse(text, mode="eval"))
        return self._closure(path, found)

    def _closure(self, path: str, uses: Iterable[Use]) -> dict[str, str]:
        waiting = list(self._places(path, uses))
        found: dict[_Place, str] = {}
        while waiting:
            place = waiting.pop()
            if place not in found:
                found[place] = self._source(place)
                waiting += self._beyond(place)
        return {f"{one.path} {one.name}".strip(): found[one] for one in sorted(found)}

    def _beyond(self, place: _Place) -> Iterator[_Place]:
        """Yield the places that the source of this place calls. A class includes its methods."""
        module = self._module(place.path)
        for node in module.nodes_of(place.name) if place.name else [module.tree]:
            uses = uses_in(node, place.name.rpartition(".")[0])
            whole = isinstance(node, ast.ClassDef)
            yield from self._places(place.path, (use for use in uses if not (whole and use.owner)), place.me)
            yield from self._files(place.path, node)

    def _source(self, place: _Place) -> str:
        data = self._tree.files[place.path]
        text = self._module(place.path).source_of(place.name, data) if place.name else data
        return text.decode("utf-8", "surrogateescape")

    def _files(self, path: str, node: ast.AST) -> Iterator[_Place]:
        """Yield files in the same folder that the source names and that are not Python: C code, a table."""
        folder = PurePosixPath(path).parent
        for one in ast.walk(node):
            if isinstance(one, ast.Constant) and isinstance(one.value, str) and "." in one.value:
                named = (folder / one.value).as_posix()
                if named in self._tree.files and not named.endswith(".py"):
                    yield _Place(named, "")

    def _places(self, path: str, uses: Iterable[Use], me: _Class | None = None) -> Iterator[_Place]:
        for use in uses:
            if use.words[0] == PROBE_NAME:
                continue
            if use.imported:
                yield from self._imported(path, use.imported, use.words[1:], 0)
            elif use.owner:
                here, name = (path, use.owner), use.words[1]
                if use.words[0] == SUPER:
                    yield from self._of_bases(here, name, me or here, 0)
                else:
                    yield from self._of_self(me or here, name, me or here, 0)
            else:
                yield from self._named(path, use.words, 0)

    def _named(self, path: str, words: tuple[str, ...], depth: int) -> Iterator[_Place]:
        module = self._module(path)
        if depth > _FURTHEST or not words:
            return
        if module.nodes_of(words[0]):
            yield _Place(path, words[0])
        for one in module.imports.get(words[0], ()):
            yield from self._imported(path, one, words[1:], depth + 1)
        for one in module.imports.get("*", ()) if not module.knows(words[0]) else ():
            if (target := self._path(one.absolute(path))) and target != path:
                yield from self._named(target, words, depth + 1)

    def _imported(self, path: str, one: Import, words: tuple[str, ...], depth: int) -> Iterator[_Place]:
        name = one.absolute(path)
        if one.name is not None:
            target, name = self._path(name), ".".join(filter(None, (name, one.name)))
            own = target and target != path  # `from . import x` in a package: x is a module, not a name in it
            if target and own and (self._module(target).knows(one.name) or not self._path(name)):
                yield from self._named(target, (one.name, *words), depth + 1)
                return
        while words and self._path(f"{name}.{words[0]}"):
            if (here := self._path(name)) and self._module(here).knows(words[0]):
                break
            name, words = f"{name}.{words[0]}", words[1:]
        if target := self._path(name):
            if words:
                yield from self._named(target, words, depth + 1)
            else:
                yield _Place(target, "")

    def _of_self(self, owner: _Class, name: str, me: _Class, depth: int) -> Iterator[_Place]:
        """Yield the method that `self.name` refers to in an object of `me`."""
        path, inside = owner
        if self._module(path).nodes_of(f"{inside}.{name}"):
            yield _Place(path, f"{inside}.{name}", me)
        else:
            yield from self._of_bases(owner, name, me, depth)

    def _of_bases(self, owner: _Class, name: str, me: _Class, depth: int) -> Iterator[_Place]:
        """Yield the method that `super().name` refers to in an object of `me`."""
        path, inside = owner
        for words in self._module(path).bases_of(inside) if depth < _FURTHEST else ():
            for base in self._named(path, words, 0):
                yield from self._of_self((base.path, base.name), name, me, depth + 1)

    def _module(self, path: str) -> Module:
        return self._tree.derived(path, source_names.read_module)

    def _path(self, module: str) -> str | None:
        stem = module.replace(".", "/")
        return next(
            (path for path in (f"{stem}.py", f"{stem}/__init__.py") if path in self._tree.files), None
        )


def _injected(data: bytes) -> Callable[[ast.expr], bool]:
    """Return a predicate for the injected nodes of a mutated file: those in inserted lines, and those in the
    new parts of changed lines.
    """
    tags = {number: tag for number, line in enumerate(data.splitlines(), 1) if (tag := tag_of(line))}
    changed = [(line, first, end) for _, line, first, end in changed_value_positions(data)]

    def is_injected(node: ast.expr) -> bool:
        tag = tags.get(node.lineno)
        if tag is None or not tag.is_of_fault:
            return False
        within = (line == node.lineno and first <= node.col_offset < end for line, first, end in changed)
        return tag.replaced_line is None or any(within)

    return is_injected
