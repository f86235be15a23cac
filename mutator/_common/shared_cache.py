"""The cache that all commands share: layout, size and pruning.

    $XDG_CACHE_HOME/mutator, or ~/.cache/mutator
      checks/<digest>/     passed checks of campaigns, with their golden runs
      goldens/<digest>/    golden runs that a cluster worker ran
      runs/<digest>.json   verified run folders
      lines/<digest>.json  lines that a golden run executes
      pictures/<digest>.json  effects of image faults, for review
      pages/<digest>/      reports that the server built
      targets/<name>/      files that a target keeps for its runs (`{cache}` in its manifest)

Results never depend on the cache. Each entry is found by a digest of its inputs and checked before use. An
unwritable or damaged cache is ignored, and you can delete any entry at any time.
"""

import os
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from mutator._common.hashing import content_id

CHECKS, GOLDENS, RUNS = "checks", "goldens", "runs"
LINES, PICTURES, PAGES, TARGETS = "lines", "pictures", "pages", "targets"
_LONGEST_NAME = 200
TARGET_BYTES = 4_000_000_000  # size limit for one target, enforced between seeds
PAGES_BYTES = 500_000_000  # size limit for all reports that the server built


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A cached item that is kept or deleted as a whole.

    `what` is the part of the cache: `checks`, `goldens`, `runs`, `lines`, `pictures`, `pages` or, for
    example, `target openpilot`. `size` is the size on disk in bytes, `used` the time of the last use in
    seconds since the epoch.
    """

    what: str
    path: Path
    size: int
    used: float

    def delete(self) -> None:
        """Delete the entry; a missing entry is ignored."""
        if self.path.is_dir() and not self.path.is_symlink():
            shutil.rmtree(self.path, ignore_errors=True)
        else:
            self.path.unlink(missing_ok=True)


def folder() -> Path:
    """Return the folder of all caches, which need not exist."""
    named = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if named.is_absolute():
        return named / "mutator"
    try:
        return Path.home() / ".cache" / "mutator"
    except RuntimeError:
        return Path(os.devnull) / "mutator"


def of_checks() -> Path:
    return folder() / CHECKS


def of_goldens() -> Path:
    return folder() / GOLDENS


def of_runs() -> Path:
    return folder() / RUNS


def of_lines() -> Path:
    return folder() / LINES


def of_pictures() -> Path:
    return folder() / PICTURES


def of_pages() -> Path:
    return folder() / PAGES


def of_target(name: str) -> Path:
    """Return the folder that all runs of a target share."""
    quoted = quote(name, safe="").replace(".", "%2E")
    return folder() / TARGETS / (quoted if len(quoted) <= _LONGEST_NAME else content_id(name))


def entries() -> list[Entry]:
    """List all cached entries. Each file that a target keeps is an entry."""
    found = [_entry(CHECKS, path) for path in _children(of_checks())]
    found += [_entry(GOLDENS, path) for path in _children(of_goldens())]
    found += [_entry(RUNS, path) for path in _children(of_runs())]
    found += [_entry(LINES, path) for path in _children(of_lines())]
    found += [_entry(PICTURES, path) for path in _children(of_pictures())]
    found += [_entry(PAGES, path) for path in _children(of_pages())]
    for target in _children(folder() / TARGETS):
        found += [_entry(f"target {target.name}", path) for path in _files(target)]
    return sorted(found, key=lambda entry: (entry.what, entry.path))


def prune(most: int) -> list[Entry]:
    """Delete the least recently used entries until at most `most` bytes remain; return the deleted ones."""
    return _pruned(entries(), most)


def make_room(target: str) -> list[Entry]:
    """Delete the least recently used files of a target until at most TARGET_BYTES remain; return the deleted
    entries.

    A run calls it before each seed, because each seed has its own images.
    """
    return _pruned([_entry(f"target {target}", path) for path in _files(of_target(target))], TARGET_BYTES)


def prune_pages() -> list[Entry]:
    """Delete the least recently used reports of the server until at most PAGES_BYTES remain; return them."""
    return _pruned([_entry(PAGES, path) for path in _children(of_pages())], PAGES_BYTES)


def _pruned(kept: list[Entry], most: int) -> list[Entry]:
    total = sum(entry.size for entry in kept)
    deleted = []
    for entry in sorted(kept, key=lambda entry: entry.used):
        if total <= most:
            break
        entry.delete()
        deleted.append(entry)
        total -= entry.size
    return deleted


def clear() -> list[Entry]:
    """Delete the whole cache; return the deleted entries."""
    deleted = entries()
    for entry in deleted:
        entry.delete()
    return deleted


def _entry(what: str, path: Path) -> Entry:
    states = list(_states([path, *_files(path)] if path.is_dir() else [path]))
    return Entry(
        what=what,
        path=path,
        size=sum(state.st_blocks * 512 for state in states),  # a sparse file takes less space than its size
        used=max((max(state.st_atime, state.st_mtime) for state in states), default=0.0),
    )


def _states(paths: Iterable[Path]) -> Iterator[os.stat_result]:
    for path in paths:
        try:
            yield path.lstat()
        except OSError:
            continue


def _children(place: Path) -> list[Path]:
    try:
        return sorted(place.iterdir())
    except OSError:  # missing, or owned by somebody else
        return []


def _files(place: Path) -> list[Path]:
    return [path for path in sorted(place.rglob("*")) if path.is_symlink() or not path.is_dir()]
