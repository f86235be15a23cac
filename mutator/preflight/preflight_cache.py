"""Cache passed checks and their golden runs on this machine for other run folders with the same sources."""

import platform
import shutil
from pathlib import Path

from mutator._common import cache_layout_and_pruning, cached_folders
from mutator._common.confined_files import path_below
from mutator._common.hashing import digest
from mutator.preflight.unreached_triggers import OBSERVATIONS_FOLDER


def cached_checks_path(key: str) -> Path:
    """Return the path for checks with this digest. Machines with a shared home folder have separate entries,
    because the digest might not cover everything that changes last digits.
    """
    return path_below(cache_layout_and_pruning.cached_checks_folder(), digest([key, platform.node()]))


def store_passed_checks(entry: Path, run: Path, checks_file: str, observation_folder: Path) -> None:
    """Store a run folder's golden runs, check results (`checks_file`) and observations in `entry`.

    Nothing is stored if the cache is not writable.
    """

    def fill(entry_folder: Path) -> None:
        shutil.copytree(run / "golden", entry_folder / "golden")
        shutil.copy(path_below(run, checks_file), path_below(entry_folder, checks_file))
        if (observation_folder / OBSERVATIONS_FOLDER).is_dir():
            shutil.copytree(observation_folder / OBSERVATIONS_FOLDER, entry_folder / OBSERVATIONS_FOLDER)

    cached_folders.store_in_cache(entry, fill)
