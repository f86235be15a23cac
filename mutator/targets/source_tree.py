"""A target's files in memory: read once, digested once, and what others derive from each of them."""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

from mutator._common.files import check_is_text
from mutator._common.hashing import canonical, digest
from mutator.errors import MutatorError

T = TypeVar("T")


@dataclass(frozen=True)
class SourceTree:
    """Snapshot of a target: path relative to the root -> bytes; `digest` identifies it."""

    root: Path
    files: Mapping[str, bytes]
    digest: str
    _entries: Mapping[str, str] = field(repr=False)  # what the digest is made of
    _derived: dict[tuple[str, Callable[..., Any]], Any] = field(
        default_factory=dict, repr=False, compare=False
    )

    def derived(self, path: str, make: Callable[[str, bytes, Path], T]) -> T:
        """What `make(path, data, root)` returns for a file of the target; called once for each path.

        MutatorError when the target has no file at `path`; errors of `make` pass through.
        """
        key = (path, make)
        if key not in self._derived:
            if path not in self.files:
                raise MutatorError(
                    f"no file '{path}' in the target",
                    where=self.root,
                    expected="a path relative to the target's root, among the manifest's files",
                    remedy="correct the path, or add the file to the manifest's `files`",
                )
            self._derived[key] = make(path, self.files[path], self.root)
        return cast("T", self._derived[key])

    @property
    def digests(self) -> dict[str, str]:
        """The digest of each file, by path."""
        return {path: digest(data) for path, data in self.files.items()}

    def digest_with(self, changed: Mapping[str, bytes]) -> str:
        """Digest of the tree with `changed` put in."""
        return _digest({**self._entries, **_entries(changed)})


def _entries(files: Mapping[str, bytes]) -> dict[str, str]:
    """What each file puts into its tree's digest: its path and its own, as canonical text."""
    return {path: canonical([path, digest(data)]) for path, data in files.items()}


def _digest(entries: Mapping[str, str]) -> str:
    """Digest of a tree: of the canonical text of its sorted [path, digest] entries, joined from its parts."""
    return digest(f"[{','.join(entries[path] for path in sorted(entries))}]".encode())


def read_tree(root: Path, globs: Iterable[str]) -> SourceTree:
    """Read the files of `root` that match; bytecode is never part of a tree."""
    patterns = tuple(globs)
    files = {}
    for path in sorted(root.rglob("*")):
        name = path.relative_to(root).as_posix()
        if (
            path.suffix != ".pyc"
            and "__pycache__" not in path.parts
            and path.is_file()
            and matches(name, patterns)
        ):
            check_is_text(path)
            files[name] = path.read_bytes()
    entries = _entries(files)
    return SourceTree(root=root, files=files, digest=_digest(entries), _entries=entries)


def matches(path: str, globs: Iterable[str]) -> bool:
    """Whether a relative path matches one of the globs; `**` spans folders, `*` does not."""
    return any(_pattern(glob).match(path) for glob in globs)


@lru_cache(maxsize=1024)
def _pattern(glob: str) -> re.Pattern[str]:
    parts = re.split(r"(\*\*/|\*\*|\*|\?)", glob)
    special = {"**/": r"(?:.*/)?", "**": r".*", "*": r"[^/]*", "?": r"[^/]"}
    return re.compile("".join(special.get(part, re.escape(part)) for part in parts) + r"\Z")
