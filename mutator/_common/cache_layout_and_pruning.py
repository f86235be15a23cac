"""The cache that all commands share: layout, size and pruning.

    $XDG_CACHE_HOME/mutator, or ~/.cache/mutator
      checks/<digest>/     passed checks of campaigns, with their golden runs
      goldens/<digest>/    golden runs that a cluster worker ran
      runs/<digest>.json   verified run folders
      lines/<digest>.json  lines that a golden run executes
      pictures/<digest>.json  effects of image faults, for review
      pages/<digest>/      reports that the server built
      finished/<name>.runs  records and series of finished runs
      finished/<digest>/   finished runs of a run folder whose proof is still to come
      campaigns/<name>/    run folders of campaigns under pytest, without --campaign-out
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

CHECKS_CACHE, GOLDENS_CACHE, VERIFIED_RUNS_CACHE = "checks", "goldens", "runs"
EXECUTED_LINES_CACHE, IMAGE_EFFECTS_CACHE, REPORTS_CACHE, TARGET_CACHES = (
    "lines",
    "pictures",
    "pages",
    "targets",
)
FINISHED_RUNS_CACHE, CAMPAIGN_RUNS_CACHE = "finished", "campaigns"
_MOST_FOLDER_NAME_LENGTH = 200  # file systems allow 255 bytes
MOST_TARGET_CACHE_BYTES = 4_000_000_000  # size limit for one target, enforced between seeds
MOST_CACHED_REPORTS_BYTES = 500_000_000  # size limit for all reports that the server built
MOST_FINISHED_RUNS_BYTES = 4_000_000_000  # size limit for the store of finished runs
MOST_CAMPAIGN_RUNS_BYTES = 4_000_000_000  # size limit for run folders of campaigns under pytest


@dataclass(frozen=True, slots=True, kw_only=True)
class CacheEntry:
    """A cached item that is kept or deleted as a whole.

    `what` is the part of the cache: `checks`, `goldens`, `runs`, `lines`, `pictures`, `pages`, `finished`,
    `campaigns` or, for example, `target openpilot`. `size` is the size on disk in bytes, `used` the time of
    the last use in seconds since the epoch.
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


def caches_folder() -> Path:
    """Return the folder of all caches, which need not exist."""
    named = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if named.is_absolute():
        return named / "mutator"
    try:
        return Path.home() / ".cache" / "mutator"
    except RuntimeError:
        return Path(os.devnull) / "mutator"


def cached_checks_folder() -> Path:
    return caches_folder() / CHECKS_CACHE


def cached_goldens_folder() -> Path:
    return caches_folder() / GOLDENS_CACHE


def cached_verifications_folder() -> Path:
    return caches_folder() / VERIFIED_RUNS_CACHE


def cached_executed_lines_folder() -> Path:
    return caches_folder() / EXECUTED_LINES_CACHE


def cached_image_effects_folder() -> Path:
    return caches_folder() / IMAGE_EFFECTS_CACHE


def cached_reports_folder() -> Path:
    return caches_folder() / REPORTS_CACHE


def finished_runs_folder() -> Path:
    return caches_folder() / FINISHED_RUNS_CACHE


def campaign_runs_folder() -> Path:
    return caches_folder() / CAMPAIGN_RUNS_CACHE


def target_cache_folder(name: str) -> Path:
    """Return the folder that all runs of a target share."""
    quoted = quote(name, safe="").replace(".", "%2E")
    return (
        caches_folder()
        / TARGET_CACHES
        / (quoted if len(quoted) <= _MOST_FOLDER_NAME_LENGTH else content_id(name))
    )


def list_entries() -> list[CacheEntry]:
    """List all cached entries. Each file that a target keeps is an entry."""
    listed = [_build_entry(CHECKS_CACHE, path) for path in _paths_in(cached_checks_folder())]
    listed += [_build_entry(GOLDENS_CACHE, path) for path in _paths_in(cached_goldens_folder())]
    listed += [_build_entry(VERIFIED_RUNS_CACHE, path) for path in _paths_in(cached_verifications_folder())]
    listed += [_build_entry(EXECUTED_LINES_CACHE, path) for path in _paths_in(cached_executed_lines_folder())]
    listed += [_build_entry(IMAGE_EFFECTS_CACHE, path) for path in _paths_in(cached_image_effects_folder())]
    listed += [_build_entry(REPORTS_CACHE, path) for path in _paths_in(cached_reports_folder())]
    listed += [_build_entry(FINISHED_RUNS_CACHE, path) for path in _paths_in(finished_runs_folder())]
    listed += [_build_entry(CAMPAIGN_RUNS_CACHE, path) for path in _paths_in(campaign_runs_folder())]
    for target in _paths_in(caches_folder() / TARGET_CACHES):
        listed += [_build_entry(f"target {target.name}", path) for path in _files_below(target)]
    return sorted(listed, key=lambda entry: (entry.what, entry.path))


def prune_cache(most_bytes: int) -> list[CacheEntry]:
    """Delete the least recently used entries until at most `most_bytes` remain; return the deleted ones."""
    return _prune_entries(list_entries(), most_bytes)


def prune_target_cache(target: str) -> list[CacheEntry]:
    """Delete the least recently used files of a target until at most MOST_TARGET_CACHE_BYTES remain; return
    the deleted entries.

    A run calls it before each seed, because each seed has its own images.
    """
    return _prune_entries(
        [_build_entry(f"target {target}", path) for path in _files_below(target_cache_folder(target))],
        MOST_TARGET_CACHE_BYTES,
    )


def prune_cached_reports() -> list[CacheEntry]:
    """Delete the least recently used reports of the server until at most MOST_CACHED_REPORTS_BYTES remain;
    return them.
    """
    return _prune_entries(
        [_build_entry(REPORTS_CACHE, path) for path in _paths_in(cached_reports_folder())],
        MOST_CACHED_REPORTS_BYTES,
    )


def prune_finished_runs() -> list[CacheEntry]:
    """Delete the least recently used parts of the store of finished runs until at most
    MOST_FINISHED_RUNS_BYTES remain; return them.
    """
    return _prune_entries(
        [_build_entry(FINISHED_RUNS_CACHE, path) for path in _paths_in(finished_runs_folder())],
        MOST_FINISHED_RUNS_BYTES,
    )


def prune_campaign_runs() -> list[CacheEntry]:
    """Delete the least recently used run folders of campaigns under pytest until at most
    MOST_CAMPAIGN_RUNS_BYTES remain; return them.
    """
    return _prune_entries(
        [_build_entry(CAMPAIGN_RUNS_CACHE, path) for path in _paths_in(campaign_runs_folder())],
        MOST_CAMPAIGN_RUNS_BYTES,
    )


def _prune_entries(entries: list[CacheEntry], most_bytes: int) -> list[CacheEntry]:
    total = sum(entry.size for entry in entries)
    deleted = []
    for entry in sorted(entries, key=lambda entry: entry.used):
        if total <= most_bytes:
            break
        entry.delete()
        deleted.append(entry)
        total -= entry.size
    return deleted


def clear_cache() -> list[CacheEntry]:
    """Delete the whole cache; return the deleted entries."""
    deleted = list_entries()
    for entry in deleted:
        entry.delete()
    return deleted


def _build_entry(what: str, path: Path) -> CacheEntry:
    states = list(_file_states([path, *_files_below(path)] if path.is_dir() else [path]))
    return CacheEntry(
        what=what,
        path=path,
        # st_blocks counts units of 512 bytes; a sparse file takes less space than its size
        size=sum(state.st_blocks * 512 for state in states),
        used=max((_last_use(what, state) for state in states), default=0.0),
    )


def _last_use(what: str, state: os.stat_result) -> float:
    if what == FINISHED_RUNS_CACHE:  # a search reads every file, and marks the one that it uses
        return state.st_mtime
    # the later of both, because many systems update the time of access once a day at most
    return max(state.st_atime, state.st_mtime)


def _file_states(paths: Iterable[Path]) -> Iterator[os.stat_result]:
    for path in paths:
        try:
            yield path.lstat()
        except OSError:
            continue


def _paths_in(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError:  # missing, or owned by somebody else
        return []


def _files_below(folder: Path) -> list[Path]:
    return [path for path in sorted(folder.rglob("*")) if path.is_symlink() or not path.is_dir()]
