"""A bundle on a worker's disk."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from mutator._common.confined_files import check_name, path_below
from mutator._common.files import read_json
from mutator.errors import MutatorError
from mutator.model import Limits
from mutator.store.run_folder import GoldenRun

SCHEMA = "bundle/1"
META = "meta.json"


@dataclass(frozen=True)
class Site:
    """A bundle unpacked in the folder `place`."""

    place: Path

    @cached_property
    def meta(self) -> dict[str, Any]:
        """The content of meta.json; MutatorError if it is not what `Bundle.of` writes."""
        path = self.place / META
        meta = read_json(path, SCHEMA)
        try:
            check_name(meta["manifest"], path, folders=False)
            goldens = [(GoldenRun.from_stored(one["golden"]), one["digest"]) for one in meta["goldens"]]
            for golden, _ in goldens:
                check_name(golden.key, path)
            if Limits(**meta["limits"]) and meta.keys() >= {"engine", "seed", "series", "several_seeds"}:
                return meta
        except (KeyError, TypeError, ValueError):
            pass
        raise MutatorError("not the description of a bundle", where=path, remedy="start the workers again")

    @property
    def limits(self) -> Limits:
        return Limits(**self.meta["limits"])

    def scenario(self, name: str) -> Path:
        return path_below(self.place / "scenarios", f"{name}.yaml")

    @cached_property
    def goldens(self) -> dict[str, tuple[GoldenRun, str]]:
        """The golden runs with their digests, by name."""
        told = [(GoldenRun.from_stored(one["golden"]), one["digest"]) for one in self.meta["goldens"]]
        return {golden.key: (golden, digest) for golden, digest in told}
