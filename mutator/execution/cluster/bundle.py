"""The bundle: everything that a worker needs for a campaign, except the plan.

* meta.json: engine, limits, digests of the golden runs, version of mutator
* manifest/NAME: the target's manifest
* target/, overlay/: the target's tree, and files in its root that a run's arguments refer to (`{root}/...`)
* templates/: the fault models
* scenarios/: the scenario files of the golden runs

A bundle contains nothing from outside these folders, and is written nowhere else: both sides check its names.
Each machine makes the golden runs itself; their digests show whether its results equal those of the campaign.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import (
    checked_path_inside,
    checked_relative_path,
    files_inside,
    path_below,
    write_below,
)
from mutator._common.files import raising_disk_full, read_json
from mutator._common.hashing import as_json_types
from mutator._common.version import VERSION
from mutator.campaigns.run_inputs import RunInputs
from mutator.errors import MutatorError, UnsafePath
from mutator.execution.cluster.packed_bytes import pack_parcel, unpack_parcel
from mutator.execution.cluster.unpacked_bundle import BUNDLE_SCHEMA, META_FILE, UnpackedBundle
from mutator.faults.fault_model_files import load_fault_models
from mutator.faults.fault_models import TEMPLATE_FOLDER_GLOBS
from mutator.limits import MeasuredLimits
from mutator.results.table_columns import check_column_names
from mutator.store.checks_file import CHECKS_FILE as CHECKS
from mutator.store.checks_file import CHECKS_SCHEMA
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest
from mutator.targets.manifest_files import load_manifest
from mutator.workspace import Workspace

MOST_BUNDLE_BYTES = 2_000_000_000  # the command and each worker hold a bundle in memory
_BUNDLE_FOLDERS = ("manifest", "target", "overlay", "templates", "scenarios")
_ROOT_PREFIX = "{root}/"


@dataclass(frozen=True, slots=True)
class Bundle:
    data: bytes
    digest: str

    @classmethod
    def pack_for_run(cls, workspace: Workspace, folder: RunFolder, engine: str) -> "Bundle":
        """Pack what workers need for a run that has passed its checks.

        MutatorError for a file outside the folders of library and target, and for too many bytes.
        """
        parts = dict(_bundle_parts(workspace, folder, engine))
        _check_names_and_size(parts, workspace.library)
        return cls._pack(parts)

    @classmethod
    def pack_growth(cls, workspace: Workspace, folder: RunFolder, engine: str) -> "Bundle":
        """Pack what changes in a bundle when the plan of a bench grows: golden runs, and their scenarios."""
        parts = dict(_growing_parts(workspace, folder, engine))
        _check_names_and_size(parts, workspace.library)
        return cls._pack(parts)

    @classmethod
    def _pack(cls, parts: Mapping[str, bytes]) -> "Bundle":
        data = pack_parcel(parts)
        return cls(data, sha256(data).hexdigest())


def _check_names_and_size(parts: Mapping[str, bytes], where: Path) -> None:
    """Raise MutatorError unless the parts can be written into a bundle's folders, on any file system."""
    names_by_lowercase: dict[str, str] = {}
    for name in parts:
        folder = checked_relative_path(name, where).partition("/")[0]
        if name != META_FILE and (folder == name or folder not in _BUNDLE_FOLDERS):
            raise UnsafePath(
                f"the name {name!a}", where=where, expected=f"a name in {', '.join(_BUNDLE_FOLDERS)}"
            )
        if other := names_by_lowercase.get(name.casefold()):
            raise MutatorError(
                f"{other} and {name}",
                where=where,
                expected="names that differ in more than upper and lower case, on any worker's disk",
                remedy="rename one of them",
            )
        names_by_lowercase[name.casefold()] = name
    _check_size(sum(map(len, parts.values())), where)


def _check_size(size: int, where: Path) -> None:
    if size > MOST_BUNDLE_BYTES:
        raise MutatorError(
            f"{size / 1e9:.1f} GB for each worker of the cluster",
            where=where,
            expected=f"at most {MOST_BUNDLE_BYTES / 1e9:.0f} GB of tree, templates and scenarios",
            remedy="put large files where all workers can read them, and give their path in `entry.args`",
        )


def _growing_parts(workspace: Workspace, folder: RunFolder, engine: str) -> Iterator[tuple[str, bytes]]:
    head = folder.head
    manifest = workspace.manifest_of(head)
    digests = read_json(folder.path / CHECKS, CHECKS_SCHEMA)["goldens"]
    meta = {
        "schema": BUNDLE_SCHEMA,
        "mutator": VERSION,
        "engine": engine,
        "limits": as_json_types(folder.limits),
        "are_limits_measured": isinstance(folder.limits, MeasuredLimits),
        "seed": head.seed,
        "series": bool(folder.series_budget_mb),
        "several_seeds": folder.has_seeded_goldens,
        "goldens": [
            {"golden": golden.to_stored(), "digest": digests[golden.key]} for golden in folder.golden_runs
        ],
        "manifest": manifest.path.name,
        "sandbox": workspace.sandbox,
        "include": as_json_types(head.include),
        "severity": as_json_types(folder.severity_scale),
        "defences": dict(manifest.defences),
        "defence_files": sorted(manifest.defence_files),
    }
    for name in sorted({golden_run.scenario for golden_run in folder.golden_runs}):
        yield f"scenarios/{name}.yaml", read_bounded(workspace.scenario(name))
    yield META_FILE, json.dumps(meta).encode()


def _bundle_parts(workspace: Workspace, folder: RunFolder, engine: str) -> Iterator[tuple[str, bytes]]:
    yield from _growing_parts(workspace, folder, engine)
    manifest = workspace.manifest_of(folder.head)
    yield f"manifest/{manifest.path.name}", read_bounded(manifest.path)
    tree = manifest.tree
    for path, data in tree.files.items():
        yield f"{'overlay' if path in tree.overlaid_paths else 'target'}/{path}", data
    for file in _files_named_by_arguments(manifest):
        name = file.relative_to(manifest.root).as_posix()
        if name not in tree.files:
            _check_size(file.stat().st_size, file)
            yield f"target/{name}", read_bounded(file)
    for kind in TEMPLATE_FOLDER_GLOBS:
        for file in sorted(workspace.templates.glob(kind)):
            yield f"templates/{file.name}", read_bounded(checked_path_inside(workspace.templates, file))


def _files_named_by_arguments(manifest: TargetManifest) -> Iterator[Path]:
    """Yield the files that a run's arguments name, or that are in folders that they name."""
    for i, word in enumerate(manifest.entry_args):
        if word.startswith(_ROOT_PREFIX):
            with manifest.source.locating_errors(("entry", "args", i)):
                name = checked_relative_path(word.removeprefix(_ROOT_PREFIX).removesuffix("/"), manifest.path)
                place = checked_path_inside(manifest.root, path_below(manifest.root, name))
                files = files_inside(manifest.root, name, "*")
            yield from (path for path in (place, *files) if path.is_file())


def unpack_bundle(data: bytes, folder: Path) -> None:
    """Write the files of a bundle into the new `folder`; MutatorError if a bundle cannot have them."""
    parts = unpack_parcel(data)
    _check_names_and_size(parts, folder)
    with raising_disk_full(folder):
        for name, content in parts.items():
            path = path_below(folder, name)  # a new folder has no links
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)


def unpack_growth(data: bytes, folder: Path) -> None:
    """Write new golden runs and their scenarios into the bundle in `folder`, whose processes go on reading
    it; MutatorError for other files.
    """
    parts = unpack_parcel(data)
    _check_names_and_size(parts, folder)
    for name in parts:
        if name != META_FILE and not name.startswith("scenarios/"):
            raise UnsafePath(f"the name {name!a}", where=folder, expected="golden runs and scenarios only")
    for name, content in parts.items():  # the description, which names the others, comes last
        write_below(folder, name, content)


def load_run_inputs(bundle: UnpackedBundle) -> RunInputs:
    """Read the YAML of an unpacked bundle. The target's root is in the bundle."""
    overlay = bundle.folder / "overlay"
    manifest = load_manifest(
        path_below(bundle.folder / "manifest", bundle.meta["manifest"]),
        bundle.folder / "target",
        overlay if overlay.is_dir() else None,
    )
    check_column_names(manifest)
    manifest = replace(manifest, sandbox=bundle.meta["sandbox"], defences=bundle.meta["defences"])
    return RunInputs(
        manifest=replace(manifest, defence_files=bundle.defence_files),
        fault_models=load_fault_models(bundle.folder / "templates"),
        scenario_files={
            golden.scenario: bundle.scenario_path(golden.scenario)
            for golden, _ in bundle.golden_and_digest_by_key.values()
        },
    )
