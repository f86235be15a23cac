"""The bundle: everything that a worker needs for a campaign, except the plan.

* meta.json: engine, limits, digests of the golden runs, version of mutator
* manifest/NAME: the target's manifest
* target/, overlay/: the target's tree, and files in its root that a run's arguments refer to (`{root}/...`)
* templates/: the fault models
* scenarios/: the scenario files of the golden runs

Each machine makes the golden runs itself; their digests show whether its results equal those of the campaign.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any

from mutator._common.files import raising_disk_full, read_json
from mutator._common.version import VERSION
from mutator.execution.cluster.parcel import pack, unpack
from mutator.faults.fault_models import FaultModels, load_fault_models
from mutator.model import Limits
from mutator.outcomes.columns import check_names
from mutator.store.check_results import FILE as CHECKS
from mutator.store.check_results import SCHEMA as CHECKS_SCHEMA
from mutator.store.run_folder import GoldenRun, RunFolder
from mutator.targets.manifest import TargetManifest
from mutator.targets.manifest_files import load_manifest
from mutator.workspace import Workspace

SCHEMA = "bundle/1"
_ROOT = "{root}/"


@dataclass(frozen=True, slots=True)
class Bundle:
    data: bytes
    digest: str

    @classmethod
    def of(cls, workspace: Workspace, folder: RunFolder, engine: str) -> "Bundle":
        """Pack what workers need for a run that has passed its checks."""
        data = pack(dict(_parts(workspace, folder, engine)))
        return cls(data, sha256(data).hexdigest())


def _parts(workspace: Workspace, folder: RunFolder, engine: str) -> Iterator[tuple[str, bytes]]:
    head = folder.head
    manifest = workspace.manifest(head["target"])
    digests = read_json(folder.path / CHECKS, CHECKS_SCHEMA)["goldens"]
    meta = {
        "schema": SCHEMA,
        "mutator": VERSION,
        "engine": engine,
        "limits": head["limits"],
        "seed": head["seed"],
        "series": bool(folder.series_mb),
        "several_seeds": len(folder.seeds) > 1,
        "goldens": [{"golden": one.plain(), "digest": digests[one.key]} for one in folder.goldens],
        "manifest": manifest.path.name,
    }
    yield "meta.json", json.dumps(meta).encode()
    yield f"manifest/{manifest.path.name}", manifest.path.read_bytes()
    tree = manifest.tree
    for path, data in tree.files.items():
        yield f"{'overlay' if path in tree.overlaid else 'target'}/{path}", data
    for file in _read_in_root(manifest):
        name = file.relative_to(manifest.root).as_posix()
        if name not in tree.files:
            yield f"target/{name}", file.read_bytes()
    yield from _below(workspace.templates, "templates")
    for name in sorted(folder.scenarios):
        yield f"scenarios/{name}.yaml", workspace.scenario(name).read_bytes()


def _read_in_root(manifest: TargetManifest) -> list[Path]:
    named = [word.removeprefix(_ROOT) for word in manifest.entry_args if word.startswith(_ROOT)]
    places = [manifest.root / name for name in named]
    return sorted(path for place in places for path in (place, *place.rglob("*")) if path.is_file())


def _below(folder: Path, name: str) -> Iterator[tuple[str, bytes]]:
    for path in sorted(folder.rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            yield f"{name}/{path.relative_to(folder).as_posix()}", path.read_bytes()


def lay_out(data: bytes, place: Path) -> None:
    """Write the files of a bundle into the folder `place`; MutatorError if the bundle is damaged."""
    with raising_disk_full(place):
        for name, content in unpack(data).items():
            path = place / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)


@dataclass(frozen=True)
class Site:
    """A bundle unpacked in the folder `place`."""

    place: Path

    @cached_property
    def meta(self) -> dict[str, Any]:
        return read_json(self.place / "meta.json", SCHEMA)

    @cached_property
    def manifest(self) -> TargetManifest:
        """The target's manifest, with the root in the unpacked bundle."""
        path = self.place / "manifest" / self.meta["manifest"]
        overlay = self.place / "overlay"
        found = load_manifest(path, self.place / "target", overlay if overlay.is_dir() else None)
        check_names(found)
        return found

    @cached_property
    def models(self) -> FaultModels:
        return load_fault_models(self.place / "templates")

    @property
    def limits(self) -> Limits:
        return Limits(**self.meta["limits"])

    def scenario(self, name: str) -> Path:
        return self.place / "scenarios" / f"{name}.yaml"

    @cached_property
    def goldens(self) -> dict[str, tuple[GoldenRun, str]]:
        """The golden runs with their digests, by name."""
        told = [(GoldenRun.from_plain(one["golden"]), one["digest"]) for one in self.meta["goldens"]]
        return {golden.key: (golden, digest) for golden, digest in told}
