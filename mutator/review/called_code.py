"""The target's code that injected lines call, found by its names: what runs beside what a reviewer reads.

A name leads through imports to a function, a class or a constant of the tree, and its source to further
names. Classes count whole, with their bases; of `self` the method that is named. What only a value can tell
(a method of an argument, say) is not followed, and annotations call nothing.
"""

import ast
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from mutator.config.locations import PROBE_NAME
from mutator.mutants.injected_lines import changed_parts, tag_of
from mutator.review import source_names
from mutator.review.source_names import SUPER, Import, Module, Use, uses_in
from mutator.targets.source_tree import SourceTree

_Class = tuple[str, str]  # its file, its name
_FURTHEST = 20  # imports from one module to the next that a name is followed through


@dataclass(frozen=True, slots=True, order=True)
class _Place:
    """Something in the tree that has source: `name` in the file at `path`, or all of it (no name). Of a
    method, `me` is the class of the object: it may have methods of its own for a base's."""

    path: str
    name: str
    me: _Class | None = None


class CalledCode:
    """Finds what is called in one tree."""

    def __init__(self, tree: SourceTree) -> None:
        self._tree = tree

    def of_lines(self, path: str, data: bytes) -> dict[str, str]:
        """What the injected lines of faults call in `data`, the mutated file at `path`.

        Source by place: `car/weather.py Rain`; of a file that is no Python all of it.
        """
        module = source_names.read_module(path, data, Path())
        return self._closure(path, uses_in(module.tree, wanted=_injected(data)))

    def of_expressions(self, path: str, function: str, texts: Iterable[str]) -> dict[str, str]:
        """The same for expressions that are to stand in a function; what is no expression calls nothing."""
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
        """What the source of a place calls in its turn; a class has its methods already."""
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
        """Files beside this one that are no Python and that its source names: C code, a table."""
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
        """What a name of the module at `path` leads to; `words` are the name and its attributes."""
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
        """What an import leads to, and the attributes after it."""
        name = one.absolute(path)
        if one.name is not None:
            target, name = self._path(name), ".".join(filter(None, (name, one.name)))
            own = target and target != path  # `from . import x` in a package: x is no name of its own
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
        """The method of a class, or else of its bases, that `self.name` names in an object of `me`."""
        path, inside = owner
        if self._module(path).nodes_of(f"{inside}.{name}"):
            yield _Place(path, f"{inside}.{name}", me)
        else:
            yield from self._of_bases(owner, name, me, depth)

    def _of_bases(self, owner: _Class, name: str, me: _Class, depth: int) -> Iterator[_Place]:
        """The same of the bases alone, for `super().name`."""
        path, inside = owner
        for words in self._module(path).bases_of(inside) if depth < _FURTHEST else ():
            for base in self._named(path, words, 0):
                yield from self._of_self((base.path, base.name), name, me, depth + 1)

    def _module(self, path: str) -> Module:
        return self._tree.derived(path, source_names.read_module)

    def _path(self, module: str) -> str | None:
        """The file of a module of the tree."""
        stem = module.replace(".", "/")
        return next(
            (path for path in (f"{stem}.py", f"{stem}/__init__.py") if path in self._tree.files), None
        )


def _injected(data: bytes) -> Callable[[ast.expr], bool]:
    """Whether a node of a mutated file was injected: an inserted line, the new value in a changed one."""
    tags = {number: tag for number, line in enumerate(data.splitlines(), 1) if (tag := tag_of(line))}
    changed = [(line, first, end) for _, line, first, end in changed_parts(data)]

    def is_injected(node: ast.expr) -> bool:
        tag = tags.get(node.lineno)
        if tag is None or not tag.of_fault:
            return False
        within = (line == node.lineno and first <= node.col_offset < end for line, first, end in changed)
        return tag.was is None or any(within)

    return is_injected
