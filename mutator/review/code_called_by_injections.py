"""Finds, by name, the target code that injected lines call, so that reviewers can see it.

Names are resolved through imports, transitively, to functions, classes and constants of the tree. Classes are
included whole, with their bases; for a call on `self`, only the called method is. Calls that depend on values
(a method of an argument, say) are not followed. Annotations are ignored.
"""

import ast
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from mutator.config.location_syntax import PROBE_MODULE_NAME
from mutator.mutants.injected_line_syntax import changed_value_positions, tag_of
from mutator.review import source_definitions_and_uses
from mutator.review.source_definitions_and_uses import (
    SUPER,
    NameUse,
    SourceImport,
    SourceModule,
    external_names_used_in,
)
from mutator.targets.source_tree import SourceTree

_ClassKey = tuple[str, str]  # its file, its name
_MOST_IMPORT_STEPS = 20  # imports to follow for a name; modules can import each other in a circle


@dataclass(frozen=True, slots=True, order=True)
class _Definition:
    """A piece of the source tree: `name` in the file at `path`, or the whole file (no name). For a method,
    `self_class` is the class of the object on which it is called.
    """

    path: str
    name: str
    self_class: _ClassKey | None = None


class CalledCode:
    def __init__(self, tree: SourceTree) -> None:
        self._tree = tree

    def called_by_injected_lines(self, path: str, mutated_file: bytes) -> dict[str, str]:
        """Return the code that the injected lines of a mutated file call: the source of each place, such as
        `car/weather.py Rain`. `mutated_file` is the content of the file at `path`. Files other than Python
        are included whole.
        """
        module = source_definitions_and_uses.parse_module(path, mutated_file, Path())
        return self._sources_with_callees(
            path, external_names_used_in(module.tree, selection=_InjectedNodes(mutated_file))
        )

    def called_by_expressions(self, path: str, function: str, texts: Iterable[str]) -> dict[str, str]:
        """Return the code that expressions would call in a function. Invalid expressions are ignored."""
        node, owner = self._module(path).find_function(function), function.rpartition(".")[0]
        uses: list[NameUse] = []
        for text in texts:
            with suppress(SyntaxError):
                uses += source_definitions_and_uses.external_names_used_inside_function(
                    node, owner, ast.parse(text, mode="eval")
                )
        return self._sources_with_callees(path, uses)

    def _sources_with_callees(self, path: str, uses: Iterable[NameUse]) -> dict[str, str]:
        pending = list(self._definitions_of_uses(path, uses))
        source_by_definition: dict[_Definition, str] = {}
        while pending:
            place = pending.pop()
            if place not in source_by_definition:
                source_by_definition[place] = self._source(place)
                pending += self._called_definitions(place)
        return {
            f"{definition.path} {definition.name}".strip(): source_by_definition[definition]
            for definition in sorted(source_by_definition)
        }

    def _called_definitions(self, definition: _Definition) -> Iterator[_Definition]:
        """Yield the places that the source of this place calls. A class includes its methods."""
        module = self._module(definition.path)
        for node in module.definitions_of(definition.name) if definition.name else [module.tree]:
            uses = external_names_used_in(node, definition.name.rpartition(".")[0])
            is_class = isinstance(node, ast.ClassDef)
            yield from self._definitions_of_uses(
                definition.path,
                (use for use in uses if not (is_class and use.owning_class)),
                definition.self_class,
            )
            yield from self._named_data_files(definition.path, node)

    def _source(self, definition: _Definition) -> str:
        data = self._tree.files[definition.path]
        text = self._module(definition.path).source_of(definition.name, data) if definition.name else data
        return text.decode("utf-8", "surrogateescape")

    def _named_data_files(self, path: str, node: ast.AST) -> Iterator[_Definition]:
        """Yield files in the same folder that the source names and that are not Python: C code, a table."""
        folder = PurePosixPath(path).parent
        for constant in ast.walk(node):
            if (
                isinstance(constant, ast.Constant)
                and isinstance(constant.value, str)
                and "." in constant.value
            ):
                named = (folder / constant.value).as_posix()
                if named in self._tree.files and not named.endswith(".py"):
                    yield _Definition(named, "")

    def _definitions_of_uses(
        self, path: str, uses: Iterable[NameUse], self_class: _ClassKey | None = None
    ) -> Iterator[_Definition]:
        for use in uses:
            if use.name_parts[0] == PROBE_MODULE_NAME:  # the probe has a group of its own
                continue
            if use.imported:
                yield from self._definitions_of_import(path, use.imported, use.name_parts[1:], 0)
            elif use.owning_class:
                here, name = (path, use.owning_class), use.name_parts[1]
                if use.name_parts[0] == SUPER:
                    yield from self._methods_of_bases(here, name, self_class or here, 0)
                else:
                    yield from self._methods_of_self(self_class or here, name, self_class or here, 0)
            else:
                yield from self._definitions_of_name(path, use.name_parts, 0)

    def _definitions_of_name(self, path: str, words: tuple[str, ...], depth: int) -> Iterator[_Definition]:
        module = self._module(path)
        if depth > _MOST_IMPORT_STEPS or not words:
            return
        if module.definitions_of(words[0]):
            yield _Definition(path, words[0])
        for import_ in module.imports.get(words[0], ()):
            yield from self._definitions_of_import(path, import_, words[1:], depth + 1)
        for import_ in module.imports.get("*", ()) if not module.has_name(words[0]) else ():
            if (target := self._path_of_module(import_.full_name(path))) and target != path:
                yield from self._definitions_of_name(target, words, depth + 1)

    def _definitions_of_import(
        self, path: str, import_: SourceImport, words: tuple[str, ...], depth: int
    ) -> Iterator[_Definition]:
        name = import_.full_name(path)
        if import_.name is not None:
            target, name = self._path_of_module(name), ".".join(filter(None, (name, import_.name)))
            is_other_module = (
                target and target != path
            )  # `from . import x` in a package: x is a module, not a name in it
            if (
                target
                and is_other_module
                and (self._module(target).has_name(import_.name) or not self._path_of_module(name))
            ):
                yield from self._definitions_of_name(target, (import_.name, *words), depth + 1)
                return
        while words and self._path_of_module(f"{name}.{words[0]}"):
            if (here := self._path_of_module(name)) and self._module(here).has_name(words[0]):
                break
            name, words = f"{name}.{words[0]}", words[1:]
        if target := self._path_of_module(name):
            if words:
                yield from self._definitions_of_name(target, words, depth + 1)
            else:
                yield _Definition(target, "")

    def _methods_of_self(
        self, owner: _ClassKey, name: str, self_class: _ClassKey, depth: int
    ) -> Iterator[_Definition]:
        """Yield the method that `self.name` refers to in an object of `self_class`."""
        path, inside = owner
        if self._module(path).definitions_of(f"{inside}.{name}"):
            yield _Definition(path, f"{inside}.{name}", self_class)
        else:
            yield from self._methods_of_bases(owner, name, self_class, depth)

    def _methods_of_bases(
        self, owner: _ClassKey, name: str, self_class: _ClassKey, depth: int
    ) -> Iterator[_Definition]:
        """Yield the method that `super().name` refers to in an object of `self_class`."""
        path, inside = owner
        for words in self._module(path).bases_of(inside) if depth < _MOST_IMPORT_STEPS else ():
            for base in self._definitions_of_name(path, words, 0):
                yield from self._methods_of_self((base.path, base.name), name, self_class, depth + 1)

    def _module(self, path: str) -> SourceModule:
        return self._tree.derive_once(path, source_definitions_and_uses.parse_module)

    def _path_of_module(self, module: str) -> str | None:
        stem = module.replace(".", "/")
        return next(
            (path for path in (f"{stem}.py", f"{stem}/__init__.py") if path in self._tree.files), None
        )


class _InjectedNodes:
    """The injected nodes of a mutated file: those in inserted lines, and those in the new parts of changed
    lines.
    """

    def __init__(self, mutated_file: bytes) -> None:
        self._tag_by_line = {
            number: tag for number, line in enumerate(mutated_file.splitlines(), 1) if (tag := tag_of(line))
        }
        self._changed_parts = [
            (line, first, end) for _, line, first, end in changed_value_positions(mutated_file)
        ]

    def may_contain(self, first_line: int, last_line: int) -> bool:
        return any(first_line <= line <= last_line for line in self._tag_by_line)

    def __contains__(self, node: ast.expr) -> bool:
        tag = self._tag_by_line.get(node.lineno)
        if tag is None or not tag.is_of_fault:
            return False
        within = (
            line == node.lineno and first <= node.col_offset < end for line, first, end in self._changed_parts
        )
        return tag.replaced_line is None or any(within)
