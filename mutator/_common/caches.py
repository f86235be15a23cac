"""What is kept from one command to the next: where it lies, how much it is, and how it is kept small.

    $XDG_CACHE_HOME/mutator, or ~/.cache/mutator
      checks/<digest>/     passed checks of campaigns, with their golden runs
      goldens/<digest>/    golden runs that a worker of a cluster drove
      runs/<digest>.json   finished runs that were verified: what was found
      lines/<digest>.json  the lines that a golden run executes
      pictures/<digest>.json  what image effects do to a picture, for their review
      targets/<name>/      what a target keeps for its own runs: the place `{cache}` of its manifest

Results never depend on it: an entry is found by a digest of all it follows from, and is checked before it is
used. An unwritable or damaged cache is ignored, and any entry may be deleted at any time.
"""

import os
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

CHECKS, GOLDENS, RUNS = "checks", "goldens", "runs"
LINES, PICTURES, TARGETS = "lines", "pictures", "targets"
TARGET_BYTES = 4_000_000_000  # that a target may keep while it is driven with many seeds


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """Something in the cache that is kept or deleted as a whole.

    `what` says whose it is: `checks`, `goldens`, `runs`, `lines`, `pictures`, `target openpilot`. `size` is
    its size on the disk in bytes, `used` when it was last read or written, in seconds since the epoch.
    """

    what: str
    path: Path
    size: int
    used: float

    def delete(self) -> None:
        """Delete it; a missing entry is ignored."""
        if self.path.is_dir() and not self.path.is_symlink():
            shutil.rmtree(self.path, ignore_errors=True)
        else:
            self.path.unlink(missing_ok=True)


def folder() -> Path:
    """The folder of all caches, which need not exist. Where no home is known it is one that cannot."""
    named = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if named.is_absolute():
        return named / "mutator"
    try:
        return Path.home() / ".cache" / "mutator"
    except RuntimeError:
        return Path(os.devnull) / "mutator"


def of_checks() -> Path:
    """Where passed checks are kept."""
    return folder() / CHECKS


def of_goldens() -> Path:
    """Where a worker of a cluster keeps the golden runs that it drove."""
    return folder() / GOLDENS


def of_runs() -> Path:
    """Where it is kept which runs were verified."""
    return folder() / RUNS


def of_lines() -> Path:
    """Where it is kept which lines golden runs execute."""
    return folder() / LINES


def of_pictures() -> Path:
    """Where it is kept what image effects do to a picture."""
    return folder() / PICTURES


def of_target(name: str) -> Path:
    """Where the target of that name keeps what its runs share; any name is one folder there."""
    return folder() / TARGETS / quote(name, safe="").replace(".", "%2E")


def entries() -> list[Entry]:
    """All that is cached: each campaign's checks, each verified run, and each file that a target keeps."""
    found = [_entry(CHECKS, path) for path in _children(of_checks())]
    found += [_entry(GOLDENS, path) for path in _children(of_goldens())]
    found += [_entry(RUNS, path) for path in _children(of_runs())]
    found += [_entry(LINES, path) for path in _children(of_lines())]
    found += [_entry(PICTURES, path) for path in _children(of_pictures())]
    for target in _children(folder() / TARGETS):
        found += [_entry(f"target {target.name}", path) for path in _files(target)]
    return sorted(found, key=lambda entry: (entry.what, entry.path))


def prune(most: int) -> list[Entry]:
    """Delete the least recently used entries until at most `most` bytes are left; what was deleted."""
    return _pruned(entries(), most)


def make_room(target: str) -> list[Entry]:
    """Delete what the target of that name has not used for longest, until it keeps at most TARGET_BYTES; what
    was deleted. A run of many seeds does so before each next one, which has pictures of its own."""
    return _pruned([_entry(f"target {target}", path) for path in _files(of_target(target))], TARGET_BYTES)


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
    """Delete all of it; what was deleted."""
    deleted = entries()
    for entry in deleted:
        entry.delete()
    return deleted


def _entry(what: str, path: Path) -> Entry:
    states = list(_states([path, *_files(path)] if path.is_dir() else [path]))
    return Entry(
        what=what,
        path=path,
        size=sum(state.st_blocks * 512 for state in states),  # a table with holes is smaller than it says
        used=max((max(state.st_atime, state.st_mtime) for state in states), default=0.0),
    )


def _states(paths: Iterable[Path]) -> Iterator[os.stat_result]:
    """The state of each that is still there."""
    for path in paths:
        try:
            yield path.lstat()
        except OSError:
            continue


def _children(place: Path) -> list[Path]:
    try:
        return sorted(place.iterdir())
    except OSError:  # not there, or not ours
        return []


def _files(place: Path) -> list[Path]:
    return [path for path in sorted(place.rglob("*")) if path.is_symlink() or not path.is_dir()]
