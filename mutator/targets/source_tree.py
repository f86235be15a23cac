"""A target's files in memory, with a cache of data derived from them."""

import errno
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import checked_path_inside, checked_relative_path, is_inside, path_below
from mutator._common.files import check_path_encodable
from mutator._common.hashing import canonical_json, digest
from mutator.errors import MutatorError
from mutator.targets.defence_lines import with_empty_defence_lines

DerivedT = TypeVar("DerivedT")
MOST_SOURCE_BYTES = 1_000_000  # bytes of a Python file
MOST_TREE_BYTES = 128_000_000  # bytes of all files, which are kept in memory
_FILES_COUNTED_PER_LINK = 100  # files for which a link counts: it takes longer, and links in links multiply
MOST_FILES = 50_000  # files and folders below the folders that a manifest's globs name
_WILDCARD_PATTERN = re.compile(r"(\*\*/|\*\*|\*|\?)")  # special characters in a glob


@dataclass(frozen=True)
class SourceTree:
    """A snapshot of a target: path relative to the root -> bytes; `digest` identifies it.

    The files of the folder `overlay` are laid over those of the root; `overlaid_paths` has their paths.
    """

    root: Path
    files: Mapping[str, bytes]
    digest: str
    _digest_inputs: Mapping[str, str] = field(repr=False)  # input of the digest
    overlay: Path | None = None
    overlaid_paths: frozenset[str] = frozenset()
    _derived_by_file: dict[tuple[str, Callable[..., Any]], Any] = field(
        default_factory=dict, repr=False, compare=False
    )
    _derived_from_all: dict[Callable[..., Any], Any] = field(default_factory=dict, repr=False, compare=False)

    def derive_once_from_all(self, make: Callable[["SourceTree"], DerivedT]) -> DerivedT:
        """Return `make(tree)`, called once; errors of `make` pass through."""
        if make not in self._derived_from_all:
            self._derived_from_all[make] = make(self)
        return cast("DerivedT", self._derived_from_all[make])

    def derive_once(
        self,
        path: str,
        make: Callable[[str, bytes, Path], DerivedT],
        *,
        with_defence_lines: bool = False,
    ) -> DerivedT:
        """Return `make(path, data, root)` for a file of the target, called once per path; `root` is the
        file's folder. By default, the lines of defences are empty in `data`.

        MutatorError if the target has no file at `path`; errors of `make` pass through.
        """
        key = (path, make)
        if key not in self._derived_by_file:
            if path not in self.files:
                raise MutatorError(
                    f"no file '{path}' in the target",
                    where=self.root,
                    expected="a path relative to the target's root, among the manifest's files",
                    remedy="correct the path, or add the file to the manifest's `files`",
                )
            root = self.overlay if self.overlay and path in self.overlaid_paths else self.root
            data = self.files[path]
            data = data if with_defence_lines else with_empty_defence_lines(data)
            self._derived_by_file[key] = make(path, data, root)
        return cast("DerivedT", self._derived_by_file[key])

    def path_as_in_specs(self, path: str) -> str:
        """Return the path of a file as a spec names it, relative to the root or the overlay."""
        for folder in (self.root, self.overlay or self.root):
            path = path.removeprefix(f"{folder}{os.sep}")
        return path

    @property
    def digest_by_path(self) -> dict[str, str]:
        return {path: digest(data) for path, data in self.files.items()}

    def digest_with_changes(self, changed: Mapping[str, bytes]) -> str:
        return _tree_digest_of({**self._digest_inputs, **_digest_inputs_of(changed)})

    def with_changes(self, changed: Mapping[str, bytes]) -> "SourceTree":
        """Return the tree with these files, which replace its own or are new."""
        inputs = {**self._digest_inputs, **_digest_inputs_of(changed)}
        return SourceTree(
            root=self.root,
            files={**self.files, **changed},
            digest=_tree_digest_of(inputs),
            _digest_inputs=inputs,
            overlay=self.overlay,
            overlaid_paths=self.overlaid_paths,
        )


def _digest_inputs_of(files: Mapping[str, bytes]) -> dict[str, str]:
    """Return what each file adds to the digest: its path and digest, as canonical text."""
    return {path: canonical_json([path, digest(data)]) for path, data in files.items()}


def _tree_digest_of(entries: Mapping[str, str]) -> str:
    return digest(f"[{','.join(entries[path] for path in sorted(entries))}]".encode())


def read_tree(
    root: Path,
    globs: Iterable[str],
    overlay: Path | None = None,
    *,
    library: Path | None = None,
    any_links: bool = False,
) -> SourceTree:
    """Read the files of `root` that match `globs` and all files of `overlay`, except bytecode. Links are
    followed as long as they stay in the root, or for the overlay in the `library` that contains it; with
    `any_links`, those of the root may end anywhere.

    MutatorError for any other link, and for a path that is in both folders.
    """
    files = _read_files(root, tuple(globs), None if any_links else root)
    laid_over = _read_files(overlay, ("**",), library or overlay) if overlay else {}
    for path in laid_over:
        if os.path.lexists(path_below(root, path)):
            raise MutatorError(
                f"'{path}' is in the overlay and in {root}",
                where=overlay,
                expected="only files that the root does not have",
                remedy="rename the overlay's file",
            )
    files |= laid_over
    entries = _digest_inputs_of(files)
    return SourceTree(
        root=root,
        files=files,
        digest=_tree_digest_of(entries),
        _digest_inputs=entries,
        overlay=overlay,
        overlaid_paths=frozenset(laid_over),
    )


def _read_files(root: Path, globs: tuple[str, ...], bounds: Path | None) -> dict[str, bytes]:
    """Read the files of `root` that match; UnsafePath for a link that leads out of the folder `bounds`."""
    file_count = 0

    def count(path: Path) -> None:
        nonlocal file_count
        file_count += _FILES_COUNTED_PER_LINK if path.is_symlink() else 1
        if file_count > MOST_FILES:
            raise MutatorError(
                f"more than {MOST_FILES:,} files and folders (a link counts as {_FILES_COUNTED_PER_LINK})",
                where=root,
                expected="the source of one controller",
                remedy="name narrower folders in the manifest's `files`",
            )

    def should_enter(folder: Path) -> bool:
        """Whether to read a folder; UnsafePath if its files could be part of the tree but are elsewhere."""
        count(folder)
        if bounds is None or is_inside(bounds, folder):
            return True
        if any(_may_match_below(folder.relative_to(root).parts, glob.split("/")) for glob in globs):
            checked_path_inside(bounds, folder)
        return False

    folders = {_WILDCARD_PATTERN.split(glob)[0].rpartition("/")[0] for glob in globs}
    name_by_path = {}
    for path in (path for name in folders for path in _files_below(root / name, should_enter)):
        count(path)
        name_by_path[path] = path.relative_to(root).as_posix()
    files: dict[str, bytes] = {}
    remaining_bytes = MOST_TREE_BYTES
    for path in sorted(path for path, name in name_by_path.items() if matches_any_glob(name, globs)):
        check_path_encodable(path)
        checked_relative_path(name_by_path[path], root)
        if bounds is not None and path.is_symlink():
            checked_path_inside(bounds, path)
        if path.is_symlink() and not path.exists():
            raise MutatorError(
                f"a link to {path.readlink()}, which does not exist",
                where=path,
                expected="a file",
                remedy="repair or remove the link, or leave it out of `files`",
            )
        if path.is_file():
            data = read_bounded(
                path, min(remaining_bytes, MOST_SOURCE_BYTES if path.suffix == ".py" else remaining_bytes)
            )
            files[name_by_path[path]] = data
            remaining_bytes -= len(data)
    return files


def _files_below(
    folder: Path, should_enter: Callable[[Path], bool], above: tuple[Path, ...] = ()
) -> Iterator[Path]:
    """Yield all files below a folder except bytecode; a link to a folder above it is not followed."""
    here = folder.resolve()
    try:
        inside = (
            list(folder.iterdir()) if folder.is_dir() and here not in above and should_enter(folder) else []
        )
    except PermissionError:
        return
    except OSError as err:
        if err.errno != errno.ELOOP:
            raise
        raise MutatorError(
            "more links in links than the system follows",
            where=folder,
            expected="the source of one controller",
            remedy="remove the links, or name narrower folders in the manifest's `files`",
        ) from None
    for path in inside:
        if path.is_dir():
            if path.name != "__pycache__":
                yield from _files_below(path, should_enter, (*above, here))
        elif path.suffix != ".pyc":
            yield path


def _may_match_below(folder: Sequence[str], glob: Sequence[str]) -> bool:
    """Whether a glob, split at `/`, can match a file below a folder."""
    for part, pattern in zip(folder, glob, strict=False):
        if "**" in pattern:
            return True
        if not _glob_pattern(pattern).match(part):
            return False
    return len(glob) > len(folder)


def matches_any_glob(path: str, globs: Iterable[str]) -> bool:
    """Whether a relative path matches one of the globs; `**` spans folders, `*` does not."""
    return any(_glob_pattern(glob).match(path) for glob in globs)


@lru_cache(maxsize=1024)  # each glob is matched with every path
def _glob_pattern(glob: str) -> re.Pattern[str]:
    parts = _WILDCARD_PATTERN.split(glob)
    special = {"**/": r"(?:.*/)?", "**": r".*", "*": r"[^/]*", "?": r"[^/]"}
    return re.compile("".join(special.get(part, re.escape(part)) for part in parts) + r"\Z")
