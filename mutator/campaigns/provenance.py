"""Records what a run depends on: digests of its sources and versions of its software."""

import platform
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from packaging.utils import canonicalize_name

from mutator._common.files import json_bytes
from mutator._common.hashing import plain
from mutator._common.version import VERSION
from mutator.campaigns import machine
from mutator.campaigns.clones import clone_state
from mutator.errors import MutatorError
from mutator.store import digests
from mutator.store.check_results import loaded_packages
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import HEAD, SCHEMA
from mutator.store.stretches import Stretch, differences

if TYPE_CHECKING:
    from mutator.workspace import Workspace

_REMEDY = "undo the change, or use another run folder"
_OWN = Path(__file__).parents[1]  # the harness


def check_sources(run: Path, frozen: dict[str, str], now: dict[str, str]) -> None:
    changed = [name for name in frozen if now.get(name) != frozen[name]]
    if changed:
        raise MutatorError(
            f"sources changed since this run was planned: {', '.join(changed)}",
            where=run,
            expected="the same target, templates and scenarios during the whole run",
            remedy=_REMEDY,
        )


def check_version(run: Path, schema: str, provenance: Mapping[str, Any]) -> None:
    """Raise MutatorError for a run folder with another schema or mutator version.

    Such a folder can be read but not resumed, because one program must produce all its results.
    """
    if (schema, provenance["mutator"]) != (SCHEMA, VERSION):
        raise MutatorError(
            f"this run was planned by mutator {provenance['mutator']} ({schema})",
            where=run,
            expected=f"mutator {VERSION} ({SCHEMA})",
            remedy="finish the run with that version, or use another folder; this run can still be read",
        )


def check_versions(folder: RunFolder, *, accept: bool = False) -> tuple[str, ...]:
    """List how Python and packages differ from the folder's last session; empty if nothing has run yet.

    MutatorError for any difference that is not accepted.
    """
    if not folder.stretches:
        return ()
    found = differences(folder.stretches[-1], machine.python(), _packages(folder))
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
    return machine.versions({*machine.required(), *loaded_packages(folder), *before, *more})


def begin_stretch(folder: RunFolder, workspace: "Workspace", *, records: str, accept: bool) -> None:
    """Record this session's software and machine in run.json, before its first experiment.

    `records` is the glob of the session's files. MutatorError as in `check_versions`.
    """
    manifest = workspace.manifest(folder.head["target"])
    places = {"library": workspace.library, "templates": workspace.templates, "target": manifest.root}
    places |= {"overlay": manifest.overlay} if manifest.overlay else {}
    packages = _packages(folder, (canonicalize_name(wanted.name) for wanted in manifest.requires))
    states = {name: clone_state(place) for name, place in ({"mutator": _OWN} | places).items()}
    add_stretch(
        folder,
        Stretch(
            accepted=check_versions(folder, accept=accept),
            python=machine.python(),
            packages={name: version for name, version in packages.items() if version},
            platform=platform.platform(),
            cpu=machine.cpu(),
            blas=machine.blas(),
            threads=machine.threads(),
            git={name: state for name, state in states.items() if state} or None,
            records=records,
        ),
    )


def add_stretch(folder: RunFolder, stretch: Stretch) -> None:
    _write_stretches(folder, [*folder.head.get("stretches", ()), plain(stretch)])


def add_machine(folder: RunFolder, machine: Mapping[str, Any]) -> None:
    *before, last = folder.head["stretches"]
    _write_stretches(
        folder, [*before, last | {"machines": [*last.get("machines", ()), plain(dict(machine))]}]
    )


def _write_stretches(folder: RunFolder, stretches: list[dict[str, Any]]) -> None:
    digests.rewrite(folder.path, HEAD, json_bytes(folder.head | {"stretches": stretches}))
    folder.head["stretches"] = stretches
