"""Cached golden runs that this machine made for earlier campaigns.

An entry's key covers everything that a golden run depends on: sources, scenario, seed, limits, and the
machine's software. Cached bytes are compared with the campaign's digest, like those of a new run.
"""

import platform
import shutil
from contextlib import suppress
from pathlib import Path

from mutator._common import cached_folders, shared_cache
from mutator._common.bounded_reading import read_bounded
from mutator._common.hashing import digest
from mutator._common.version import VERSION
from mutator.campaigns import run_environment
from mutator.execution.cluster.unpacked_bundle import Site
from mutator.preflight.preflight_rules import output_digest_of
from mutator.store.run_folder import GoldenRun
from mutator.targets.manifest import TargetManifest

_SOURCES = ("manifest", "target", "overlay")  # folders of a bundle


class DrivenGoldens:
    """The cached golden runs of a site."""

    def __init__(self, site: Site, manifest: TargetManifest) -> None:
        self._site, self._manifest = site, manifest
        files = sorted(path for name in _SOURCES for path in (site.place / name).rglob("*") if path.is_file())
        self._common = [
            VERSION,
            [[path.relative_to(site.place).as_posix(), digest(read_bounded(path))] for path in files],
            site.meta["limits"],
            run_environment.everything_outside_sources(),
            platform.node(),
        ]

    def fetch(self, golden: GoldenRun, known: str, to: Path) -> bool:
        """Copy the golden run with the digest `known` to `to`; return False if it is not cached."""
        with suppress(OSError):
            cached_folders.copy_from_cache(self._entry(golden), to)
            if output_digest_of(self._manifest, to) == known:
                return True
        shutil.rmtree(to, ignore_errors=True)
        return False

    def keep(self, golden: GoldenRun, out: Path) -> None:
        """Cache the golden run in the folder `out`, if the cache is writable."""
        cached_folders.store_in_cache(self._entry(golden), lambda made: shutil.copytree(out, made))

    def _entry(self, golden: GoldenRun) -> Path:
        scenario = digest(read_bounded(self._site.scenario(golden.scenario)))
        seed = self._site.meta["seed"] if golden.seed is None else golden.seed
        content = [*self._common, scenario, seed, list(golden.changes)]
        return shared_cache.goldens_folder() / digest(content)
