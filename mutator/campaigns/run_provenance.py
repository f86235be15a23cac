"""Records what a run depends on: digests of its sources and versions of its software."""

import platform
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from packaging.utils import canonicalize_name

from mutator._common.doors import IMPORTERS
from mutator._common.version import VERSION
from mutator.campaigns import run_environment
from mutator.campaigns.git_clone import clone_state
from mutator.errors import MutatorError
from mutator.store import file_digests
from mutator.store.check_results import loaded_packages
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import HEAD, SCHEMA
from mutator.store.work_stretches import Machine, Stretch, version_differences

if TYPE_CHECKING:
    from mutator.workspace import Workspace

_REMEDY = "undo the change, or use another run folder"
_OWN = Path(__file__).parents[1]  # the harness


def check_sources(run: Path, frozen: Mapping[str, str], now: Mapping[str, str]) -> None:
    changed = [name for name in frozen if now.get(name) != frozen[name]]
    if changed:
        raise MutatorError(
            f"sources changed since this run was planned: {', '.join(changed)}",
            where=run,
            expected="the same target, templates and scenarios during the whole run",
            remedy=_REMEDY,
        )


def check_version(folder: RunFolder) -> None:
    """Raise MutatorError for a run folder of another version of mutator.

    Such a folder can be read but not resumed, because one program must produce all its results.
    """
    if (version := folder.head.provenance.mutator) != VERSION:
        raise MutatorError(
            f"this run was planned by mutator {version} ({SCHEMA})",
            where=folder.path,
            expected=f"mutator {VERSION} ({SCHEMA})",
            remedy="finish the run with that version, or use another folder; this run can still be read",
        )


def check_versions(folder: RunFolder, *, accept: bool = False) -> tuple[str, ...]:
    """List how Python and packages differ from the folder's last session; empty if nothing has run yet.

    MutatorError for any difference that is not accepted.
    """
    if not folder.stretches:
        return ()
    found = version_differences(folder.stretches[-1], run_environment.python(), _packages(folder))
    if found and not accept:
        raise other_versions(folder.path, "this run used", found)
    return found


def other_versions(run: Path, what: str, found: Iterable[str]) -> MutatorError:
    """Return an error about different versions, for the caller to raise. Its text begins with `what`."""
    return MutatorError(
        f"{what} other versions: {'; '.join(found)}",
        where=run,
        argument="accept_versions",
        expected="the same Python and packages for a whole run",
        remedy="restore the earlier versions, or accept the new ones: `accept_versions`",
    )


def _packages(folder: RunFolder, more: Iterable[str] = ()) -> dict[str, str | None]:
    """Return the versions of the harness's requirements, packages that golden runs loaded, and `more`."""
    before = (name for stretch in folder.stretches[-1:] for name in stretch.packages)
    return run_environment.versions({*run_environment.required(), *loaded_packages(folder), *before, *more})


def begin_stretch(
    folder: RunFolder, workspace: "Workspace", *, records: str, accept: bool, packages: Iterable[str] = ()
) -> RunFolder:
    """Record this session's software and machine in run.json, before its first experiment, and return the
    folder with its new head.

    `records` is the glob of the session's files; `packages` are what it uses besides. MutatorError as in
    `check_versions`.
    """
    manifest = workspace.manifest(folder.head.target)
    places = {"library": workspace.library, "templates": workspace.templates, "target": manifest.root}
    places |= {"overlay": manifest.overlay} if manifest.overlay else {}
    importer = IMPORTERS.package_of(Path(manifest.trace_file).suffix.removeprefix("."))
    used = (*(wanted.name for wanted in manifest.requires), *packages, *([importer] if importer else []))
    versions = _packages(folder, map(canonicalize_name, used))
    states = {name: clone_state(place) for name, place in ({"mutator": _OWN} | places).items()}
    return add_stretch(
        folder,
        Stretch(
            accepted=check_versions(folder, accept=accept),
            python=run_environment.python(),
            packages={name: version for name, version in versions.items() if version},
            platform=platform.platform(),
            cpu=run_environment.cpu(),
            blas=run_environment.blas(),
            threads=run_environment.threads(),
            git={name: state for name, state in states.items() if state} or None,
            records=records,
        ),
    )


def add_stretch(folder: RunFolder, stretch: Stretch) -> RunFolder:
    return _with_stretches(folder, (*folder.stretches, stretch))


def add_machine(folder: RunFolder, machine: Machine) -> RunFolder:
    *before, last = folder.stretches
    return _with_stretches(folder, (*before, replace(last, machines=(*last.machines, machine))))


def _with_stretches(folder: RunFolder, stretches: tuple[Stretch, ...]) -> RunFolder:
    """Write run.json with these stretches of work, and return the folder as it is then."""
    file_digests.rewrite_file(folder.path, HEAD, replace(folder.head, stretches=stretches).file_bytes())
    return RunFolder(folder.path)
