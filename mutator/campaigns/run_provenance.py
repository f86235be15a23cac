"""Records what a run depends on: digests of its sources and versions of its software."""

import platform
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from packaging.utils import canonicalize_name

from mutator._common.extension_doors import TRACE_IMPORTER_DOOR
from mutator._common.version import VERSION
from mutator.campaigns import run_environment
from mutator.campaigns.git_clone import find_clone_state
from mutator.errors import MutatorError
from mutator.store import file_digests
from mutator.store.preflight_results import packages_loaded_by_golden_runs
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import HEAD, RUN_SCHEMA
from mutator.store.session_environments import SessionEnvironment, WorkerMachine, version_differences

if TYPE_CHECKING:
    from mutator.workspace import Workspace

_REMEDY = "undo the change, or use another run folder"
_HARNESS_FOLDER = Path(__file__).parents[1]  # the harness


def check_sources(run: Path, planned_digests: Mapping[str, str], current_digests: Mapping[str, str]) -> None:
    changed = [name for name in planned_digests if current_digests.get(name) != planned_digests[name]]
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
            f"this run was planned by mutator {version} ({RUN_SCHEMA})",
            where=folder.path,
            expected=f"mutator {VERSION} ({RUN_SCHEMA})",
            remedy="finish the run with that version, or use another folder; this run can still be read",
        )


def accepted_version_differences(folder: RunFolder, *, accept: bool = False) -> tuple[str, ...]:
    """List how Python and packages differ from the folder's last session; empty if nothing has run yet.

    MutatorError for any difference that is not accepted.
    """
    if not folder.session_environments:
        return ()
    changes = version_differences(
        folder.session_environments[-1], run_environment.python_version(), _versions_to_record(folder)
    )
    if changes and not accept:
        raise version_error(folder.path, "this run used", changes)
    return changes


def version_error(run: Path, beginning: str, version_differences: Iterable[str]) -> MutatorError:
    """Return an error about different versions, for the caller to raise. Its text begins with `beginning`."""
    return MutatorError(
        f"{beginning} other versions: {'; '.join(version_differences)}",
        where=run,
        argument="accept_versions",
        expected="the same Python and packages for a whole run",
        remedy="restore the earlier versions, or accept the new ones: `accept_versions`",
    )


def _versions_to_record(folder: RunFolder, more_packages: Iterable[str] = ()) -> dict[str, str | None]:
    """Return the versions of the harness's requirements, packages that golden runs loaded, and `more`."""
    before = (name for stretch in folder.session_environments[-1:] for name in stretch.packages)
    return run_environment.package_versions(
        {
            *run_environment.required_packages(),
            *packages_loaded_by_golden_runs(folder),
            *before,
            *more_packages,
        }
    )


def begin_session_environment(
    folder: RunFolder,
    workspace: "Workspace",
    *,
    records_glob: str,
    accept_versions: bool,
    packages: Iterable[str] = (),
) -> RunFolder:
    """Record this session's software and machine in run.json, before its first experiment, and return the
    folder with its new head.

    `records` is the glob of the session's files; `packages` are what it uses besides. MutatorError as in
    `accepted_version_differences`.
    """
    manifest = workspace.manifest_of(folder.head)
    folder_by_name = {"library": workspace.library, "templates": workspace.templates, "target": manifest.root}
    folder_by_name |= {"overlay": manifest.overlay} if manifest.overlay else {}
    importer = TRACE_IMPORTER_DOOR.other_package_of(Path(manifest.trace_file).suffix.removeprefix("."))
    used = (
        *(requirement.name for requirement in manifest.requires),
        *packages,
        *([importer] if importer else []),
    )
    versions = _versions_to_record(folder, map(canonicalize_name, used))
    states = {
        name: find_clone_state(place)
        for name, place in ({"mutator": _HARNESS_FOLDER} | folder_by_name).items()
    }
    return append_session_environment(
        folder,
        SessionEnvironment(
            accepted=accepted_version_differences(folder, accept=accept_versions),
            python=run_environment.python_version(),
            packages={name: version for name, version in versions.items() if version},
            platform=platform.platform(),
            cpu=run_environment.processor_name(),
            blas=run_environment.loaded_blas(),
            threads=run_environment.thread_limits(),
            git={name: state for name, state in states.items() if state} or None,
            records=records_glob,
        ),
    )


def append_session_environment(folder: RunFolder, stretch: SessionEnvironment) -> RunFolder:
    return _write_session_environments(folder, (*folder.session_environments, stretch))


def add_loaded_packages(folder: RunFolder, packages: Iterable[str] | None = None) -> RunFolder:
    """Add the versions of packages that golden runs have loaded since the session began: `packages` or, if
    None, those in checks.json.
    """
    if not folder.session_environments:
        return folder
    *before, last = folder.session_environments
    loaded = packages_loaded_by_golden_runs(folder) if packages is None else packages
    missing = {*loaded} - last.packages.keys()
    versions = run_environment.package_versions(missing)
    if not any(versions.values()):
        return folder
    packages = {**last.packages} | {name: version for name, version in versions.items() if version}
    return _write_session_environments(folder, (*before, replace(last, packages=packages)))


def append_worker_machine(folder: RunFolder, machine: WorkerMachine) -> RunFolder:
    *before, last = folder.session_environments
    return _write_session_environments(folder, (*before, replace(last, machines=(*last.machines, machine))))


def _write_session_environments(folder: RunFolder, stretches: tuple[SessionEnvironment, ...]) -> RunFolder:
    """Write run.json with these stretches of work, and return the folder as it is then."""
    file_digests.rewrite_file(folder.path, HEAD, replace(folder.head, stretches=stretches).file_bytes())
    return RunFolder(folder.path)
