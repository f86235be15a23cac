"""Find the files of a tree that a module's import loads, to compile no others.

Files are found by the names in compiled code, so nothing runs. The result is for speed only: a run compiles
what is missing. It depends on the tree alone, as the order of a set can differ between loaded and fresh
bytecode.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from types import CodeType
from typing import NamedTuple

_LOADING_FUNCTIONS = {"import_module", "__import__"}  # what they load, strings name
_MOST_NAME_CHARACTERS = 200  # of a string that can name modules
_MODULE_ENDINGS = (".py", "/__init__.py")


class ModuleNames(NamedTuple):
    """What compiled code names: with `/` for dots what its top level uses, and the words of its strings if
    it loads modules by name.
    """

    used: frozenset[str]
    in_strings: frozenset[str]


def module_names_in(code: CodeType) -> ModuleNames:
    """Return the names in a module's code. Imports inside functions are left out: most of them never run."""
    codes = list(_nested_codes(code))
    loads_by_name = any(not _LOADING_FUNCTIONS.isdisjoint(inner.co_names) for inner in codes)
    strings = (text for inner in codes for text in inner.co_consts if isinstance(text, str))
    words = (text.replace(".", " ").split() for text in strings if len(text) <= _MOST_NAME_CHARACTERS)
    return ModuleNames(
        frozenset(name.replace(".", "/") for name in code.co_names),
        frozenset(word for text in words for word in text) if loads_by_name else frozenset(),
    )


def files_imported_by(
    paths: Iterable[str], entry_module: str, names_of: Callable[[str], ModuleNames]
) -> list[str]:
    """Return those of the Python files `paths` that the import of `entry_module` loads, and a few more.

    Absolute names match the end of a path, because any folder of the tree can be on the import path.
    """
    index = _FileIndex(paths)
    entry = entry_module.replace(".", "/")
    todo = [*index.files_by_ending[entry], *index.files_by_ending[f"{entry}/__main__"]]
    reached = dict.fromkeys(todo)
    while todo:
        path = todo.pop()
        new = [file for file in index.files_named_by(path, names_of(path)) if file not in reached]
        reached |= dict.fromkeys(new)
        todo += dict.fromkeys(new)
    return list(reached)


class _FileIndex:
    def __init__(self, paths: Iterable[str]) -> None:
        self.files_by_ending: defaultdict[str, list[str]] = defaultdict(list)
        self._folder_endings: set[str] = set()
        self._files = set(paths)
        for path in self._files:
            for ending in _endings(path.removesuffix(".py").removesuffix("/__init__")):
                self.files_by_ending[ending].append(path)
        for folder in {folder for path in self._files for folder in _folders_above(path)}:
            self._folder_endings.update(_endings(folder))

    def files_named_by(self, path: str, names: ModuleNames) -> Iterator[str]:
        """Yield the files that the file `path` can import by its names, and the packages that it is in."""
        above = _folders_above(path)
        yield from self._files & {f"{folder}/__init__.py" for folder in above}
        packages = names.used & self._folder_endings
        for name in names.used:
            if "/" in name:
                yield from self.files_by_ending.get(name, ())
            for folder in ("", *above):
                module = f"{folder}/{name}".lstrip("/")
                yield from self._files & {f"{module}{ending}" for ending in _MODULE_ENDINGS}
            for package in packages:
                yield from self.files_by_ending.get(f"{package}/{name}", ())
        for word in names.in_strings:
            yield from self.files_by_ending.get(word, ())


def _folders_above(path: str) -> list[str]:
    folders = path.split("/")[:-1]
    return ["/".join(folders[: i + 1]) for i in range(len(folders))]


def _endings(path: str) -> Iterator[str]:
    parts = path.split("/")
    return ("/".join(parts[i:]) for i in range(len(parts)))


def _nested_codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _nested_codes(constant)
