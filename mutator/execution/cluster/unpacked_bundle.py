"""A bundle on a worker's disk."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import checked_relative_path, path_below
from mutator._common.files import read_json
from mutator._common.typed_json import typed_value_from_json
from mutator.errors import MutatorError
from mutator.execution.golden_hazards import GoldenHazardRules
from mutator.limits import Limits, MeasuredLimits
from mutator.model import GoldenClass
from mutator.store.golden_runs import GoldenRun
from mutator.targets.hazard_severity import SeverityScale

BUNDLE_SCHEMA = "bundle/1"
META_FILE = "meta.json"
_META_KEYS = {"are_limits_measured", "engine", "include", "seed", "series", "several_seeds", "severity"}
_META_KEYS |= {"defences", "defence_files"}


@dataclass(frozen=True)
class UnpackedBundle:
    """A bundle unpacked in `folder`."""

    folder: Path

    @cached_property
    def meta(self) -> dict[str, Any]:
        """The content of meta.json; MutatorError if it is not what `Bundle.pack_for_run` writes."""
        path = self.folder / META_FILE
        meta = read_json(path, BUNDLE_SCHEMA)
        try:
            checked_relative_path(meta["manifest"], path, allow_folders=False)
            goldens = [(GoldenRun.from_stored(entry["golden"]), entry["digest"]) for entry in meta["goldens"]]
            for name in (*(golden.key for golden, _ in goldens), *meta["defence_files"]):
                checked_relative_path(name, path)
            if Limits(**meta["limits"]) and meta.keys() >= _META_KEYS:
                return meta
        except (KeyError, TypeError, ValueError):
            pass
        raise MutatorError("not the description of a bundle", where=path, remedy="start the workers again")

    @property
    def limits(self) -> Limits:
        kind = MeasuredLimits if self.meta["are_limits_measured"] else Limits
        return kind(**self.meta["limits"])

    @property
    def golden_hazard_rules(self) -> GoldenHazardRules:
        include, scale = self.meta["include"], self.meta["severity"]
        return GoldenHazardRules(
            include=GoldenClass(include) if include else None,
            scale=typed_value_from_json(SeverityScale, scale) if scale else None,
        )

    @property
    def defence_files(self) -> dict[str, bytes]:
        """The files that defences add to the target's tree, or change, by path."""
        places = {
            name: [path_below(self.folder / part, name) for part in ("overlay", "target")]
            for name in self.meta["defence_files"]
        }
        return {
            name: read_bounded(next(path for path in paths if path.is_file()))
            for name, paths in places.items()
        }

    def scenario_path(self, name: str) -> Path:
        return path_below(self.folder / "scenarios", f"{name}.yaml")

    @cached_property
    def golden_and_digest_by_key(self) -> dict[str, tuple[GoldenRun, str]]:
        """The golden runs with their digests, by name."""
        digests_by_golden = [
            (GoldenRun.from_stored(entry["golden"]), entry["digest"]) for entry in self.meta["goldens"]
        ]
        return {golden.key: (golden, digest) for golden, digest in digests_by_golden}
