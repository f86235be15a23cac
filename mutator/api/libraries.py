"""A library made, checked and analysed, and the machine that is to use it."""

import os
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from mutator._common.files import write_atomic
from mutator._common.shipped import write_library
from mutator.api.selection import WorkspaceLike, open_workspace
from mutator.errors import MutatorError
from mutator.mutants.anchors import parsed
from mutator.mutants.listed_places import ListedPlace, places_of
from mutator.onboarding.marks import unfilled
from mutator.onboarding.new_library import write_library_for
from mutator.onboarding.survey import look_at
from mutator.stpa.analysis import Analysis
from mutator.stpa.checks import check_analysis
from mutator.stpa.drawing import draw
from mutator.targets import manifest_files
from mutator.targets.locations import check_file
from mutator.targets.upgrade import Upgrade
from mutator.verification import fast_engines, library
from mutator.verification.doctor import examine
from mutator.verification.draws import unused_draws
from mutator.verification.drive import check_drive
from mutator.verification.findings import Finding
from mutator.workspace import Workspace


def init_library(folder: str | Path, *, target: str | PathLike[str] | None = None) -> Path:
    """Write a fault library to edit into a new or empty folder, which is returned.

    With `target`, the folder of a controller's source or `installed:NAME`, it is a first library for that
    controller: manifest, entry, scenario, fault and campaign, with places to fill in. The source is read,
    never imported. Without it, library and templates are copies of what ships with mutator.
    MutatorError for a folder that holds anything, and for a target that is not there; MutatorWarning for a
    target in which nothing looks like a controller.
    """
    if target is None:
        write_library(Path(folder))
    else:
        write_library_for(look_at(os.fspath(target)), Path(folder))
    return Path(folder)


def unfilled_places(folder: str | Path) -> list[MutatorError]:
    """The places of a library's folder that are still to be filled in."""
    return list(unfilled(Path(folder)))


def upgrade_manifest(path: str | Path) -> Upgrade | None:
    """Write a target's manifest of an older schema anew, as one of today's; all that did not change stays.

    None for a manifest of today's schema, which is left alone. `lost` of the answer are comments within what
    had to be written anew. MutatorError for a file that is no manifest, which stays as it is.
    """
    upgrade = manifest_files.upgrade_manifest(Path(path))
    if upgrade is not None:
        write_atomic(Path(path).resolve(), upgrade.text.encode())  # what a link leads to
    return upgrade


def check_library(workspace: WorkspaceLike = None, *, target: str | None = None) -> list[MutatorError]:
    """Every problem of library, templates and target, in the order of the files; empty when all is well.

    `target` names a manifest; default: the library's only one.
    """
    found = open_workspace(workspace)
    return library.check_library(found, found.target_name(target))


def find_places(
    where: str, workspace: WorkspaceLike = None, *, target: str | None = None
) -> list[ListedPlace]:
    """Where faults can be injected in a file of the target, or (`FILE::FUNCTION`) in one of its functions:
    line, anchor and fault models of each place, from the top of the file to its end.

    MutatorError for a file in which no fault may be, and for a function that it does not have.
    """
    found = open_workspace(workspace)
    manifest = found.manifest(found.target_name(target))
    path, _, function = where.partition("::")
    check_file(manifest, path)
    return places_of(parsed(manifest.tree, path), found.fault_models(), function or None)


def check_target(
    workspace: WorkspaceLike = None,
    *,
    target: str | None = None,
    drive: bool = False,
    scenarios: Sequence[str] = (),
) -> list[Finding]:
    """What a target and its faults have to tell before a campaign: what keeps them from being forked, and
    draws that nothing uses.

    With `drive` golden runs are driven, of these `scenarios` (default: those of the library's campaigns, or
    all), which tell whether the target is deterministic and the likely cause if it is not, statements of
    faults and triggers that no run comes to, and canaries that do no harm. `target` names a manifest;
    default: the library's only one. MutatorError for a library with problems, which `check_library` lists.
    """
    found = open_workspace(workspace)
    name = found.target_name(target)
    manifest = found.manifest(name)
    driven = check_drive(found, name, scenarios) if drive else [fast_engines.loading(manifest)]
    unused = unused_draws(found.specs(), found.fault_models())
    return [*driven, fast_engines.variants(found, manifest), unused]


def check_hazard_analysis(
    workspace: WorkspaceLike = None, *, target: str | None = None
) -> list[MutatorError]:
    """Every gap and contradiction of the hazard analysis, in the order of the files; empty: all is well.

    `target` names a manifest; default: the library's only one. MutatorError for a library without analysis.
    """
    found = open_workspace(workspace)
    analysis = _analysis(found)
    manifest = found.manifest(found.target_name(target))
    return check_analysis(analysis, found.specs(), manifest)


def draw_control_structure(workspace: WorkspaceLike = None) -> str:
    """The control structure of the hazard analysis as SVG. MutatorError for a library without analysis."""
    return draw(_analysis(workspace))


def doctor(workspace: "Workspace | str | PathLike[str] | MutatorError | None" = None) -> list[Finding]:
    """Can this machine run campaigns? Looks at interpreter, packages, machine, library and target.

    Each finding has `name`, `level` (`ok`, `warning`, `failed`), `found`, `places` and `remedy`. That no
    library is found is one of them; `workspace` may be the error that looking for it gave.
    """
    if isinstance(workspace, MutatorError):
        return examine(workspace)
    try:
        found = open_workspace(workspace)
    except MutatorError as error:
        return examine(error)
    return examine(found)


def _analysis(workspace: WorkspaceLike) -> Analysis:
    found = open_workspace(workspace)
    analysis = found.analysis()
    if analysis is None:
        raise MutatorError(
            "no control_structure.yaml",
            where=found.library / "stpa",
            expected="a hazard analysis",
            remedy="write one, as docs/explanation/hazard-analysis.md says; campaigns need none",
        )
    return analysis
