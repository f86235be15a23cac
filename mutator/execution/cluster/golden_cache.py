"""Cached golden runs that this machine made for earlier campaigns.

An entry's key covers everything that a golden run depends on: sources, scenario, seed, limits, and the
machine's software. Cached bytes are compared with the campaign's digest, like those of a new run.
"""

import platform
import shutil
from contextlib import suppress
from pathlib import Path

from mutator._common import cache_layout_and_pruning, cached_folders
from mutator._common.bounded_reading import read_bounded
from mutator._common.hashing import digest
from mutator._common.version import VERSION
from mutator.campaigns import run_environment
from mutator.execution.cluster.unpacked_bundle import UnpackedBundle
from mutator.preflight.check_run_problems import output_digest_of
from mutator.store.golden_runs import GoldenRun
from mutator.targets.manifest import TargetManifest

_SOURCE_FOLDERS = ("manifest", "target", "overlay")  # folders of a bundle


class GoldenRunCache:
    """The cached golden runs of an unpacked bundle."""

    def __init__(self, bundle: UnpackedBundle, manifest: TargetManifest) -> None:
        self._bundle, self._manifest = bundle, manifest
        files = sorted(
            path for name in _SOURCE_FOLDERS for path in (bundle.folder / name).rglob("*") if path.is_file()
        )
        self._common_key_parts = [
            VERSION,
            [[path.relative_to(bundle.folder).as_posix(), digest(read_bounded(path))] for path in files],
            bundle.meta["limits"],
            run_environment.environment_affecting_results(),
            platform.node(),  # a cache on a shared disk has entries of many machines
        ]

    def copy_golden(self, golden: GoldenRun, expected_digest: str, destination: Path) -> bool:
        """Copy a golden run to `destination`; return False if none with `expected_digest` is cached."""
        with suppress(OSError):
            cached_folders.copy_from_cache(self._entry_folder(golden), destination)
            if output_digest_of(self._manifest, destination) == expected_digest:
                return True
        shutil.rmtree(destination, ignore_errors=True)
        return False

    def store_golden(self, golden: GoldenRun, output_folder: Path) -> None:
        """Cache the golden run in the folder `output_folder`, if the cache is writable."""
        cached_folders.store_in_cache(
            self._entry_folder(golden), lambda destination: shutil.copytree(output_folder, destination)
        )

    def _entry_folder(self, golden: GoldenRun) -> Path:
        scenario = digest(read_bounded(self._bundle.scenario_path(golden.scenario)))
        seed = self._bundle.meta["seed"] if golden.seed is None else golden.seed
        content = [*self._common_key_parts, scenario, seed, list(golden.changes)]
        return cache_layout_and_pruning.cached_goldens_folder() / digest(content)
