"""Create, check and analyse a library, and check the machine."""

import os
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from mutator._common.shipped_files import write_new_library
from mutator.api.target_and_fault_selection import WorkspaceLike, open_workspace
from mutator.checks import fast_engine_check, library_check
from mutator.checks.check_by_running import findings_from_running
from mutator.checks.check_findings import Finding
from mutator.checks.machine_check import examine_machine
from mutator.checks.unrecorded_values import unrecorded_values_finding
from mutator.checks.unused_draws_and_parameters import unused_draws_and_parameters_finding
from mutator.errors import MutatorError
from mutator.onboarding.first_library import write_first_library
from mutator.onboarding.library_import import ImportedLibrary, import_into_new_library
from mutator.onboarding.source_survey import survey_source
from mutator.onboarding.todo_marks import unfilled_mark_errors
from mutator.stpa.control_structure_svg import render_structure
from mutator.stpa.hazard_analysis_checks import list_analysis_problems
from mutator.stpa.hazard_analysis_yaml import HazardAnalysis
from mutator.workspace import Workspace


def init_library(
    folder: str | Path, *, target: str | PathLike[str] | None = None, files: Sequence[str] = ()
) -> Path:
    """Write an editable fault library into a new or empty folder, and return the folder.

    `target` is a controller's source folder or `installed:NAME`. With `target`, write a first library for
    that controller: manifest, entry, scenario, fault and campaign, with places to fill in. The source is
    read, never imported; with `files`, only files that match one of these globs, relative to that folder
    (or to where the package is installed), are searched for the controller. Without `target`, copy the
    library and templates that ship with mutator.

    MutatorError for a folder that is not empty, for a missing target, and for `files` without a target or a
    match; MutatorWarning if nothing in the
    target looks like a controller.
    """
    if target is None and files:
        raise MutatorError(
            f"files {', '.join(files)} without a target", argument="files", remedy="name a `target`, too"
        )
    if target is None:
        write_new_library(Path(folder))
    else:
        write_first_library(survey_source(os.fspath(target), files), Path(folder))
    return Path(folder)


def import_library(format: str, source: str | PathLike[str], folder: str | PathLike[str]) -> ImportedLibrary:
    """Import fault files of others: write a copy of the library that ships with mutator, with the faults in
    `source`, into a new or empty folder. The files are parsed and never executed.

    `format` is an importer ([doors](doors.md#library-importer)). The result has an entry for each line, also
    for those that are refused. MutatorError for an unknown format, for files that are not in it, if nothing
    can be imported, and for a folder that is not empty.
    """
    return import_into_new_library(format, Path(source), Path(folder))


def unfilled_places(folder: str | Path) -> list[MutatorError]:
    """Return the places in a new library that you still have to fill in."""
    return list(unfilled_mark_errors(Path(folder)))


def check_library(workspace: WorkspaceLike = None, *, target: str | None = None) -> list[MutatorError]:
    """Return every problem of the library, templates and target, in the order of the files.

    `target` names a manifest; default: the library's only one.
    """
    opened_workspace = open_workspace(workspace)
    return library_check.library_problems(opened_workspace, opened_workspace.target_name(target))


def check_target(
    workspace: WorkspaceLike = None,
    *,
    target: str | None = None,
    drive: bool = False,
    scenarios: Sequence[str] = (),
) -> list[Finding]:
    """Check a target and its faults before a campaign: report what prevents them from running on the fork
    engines, entries of `draw` that no injection uses, and observed values that no channel records.

    With `drive`, also make golden runs of `scenarios` (default: those of the library's campaigns, or all),
    and check whether the target is deterministic, whether the runs reach the statements and triggers of all
    faults, and whether canaries reach their hazard. `target` names a manifest; default: the library's only
    one. MutatorError for a library with problems, which `check_library` lists.
    """
    opened_workspace = open_workspace(workspace)
    name = opened_workspace.target_name(target)
    manifest = opened_workspace.manifest(name)
    findings = (
        findings_from_running(opened_workspace, name, scenarios)
        if drive
        else [fast_engine_check.import_and_fork_finding(manifest)]
    )
    unused = unused_draws_and_parameters_finding(opened_workspace.specs(), opened_workspace.fault_models())
    return [
        *findings,
        fast_engine_check.unloadable_variants_finding(opened_workspace, manifest),
        unused,
        unrecorded_values_finding(manifest),
    ]


def check_hazard_analysis(
    workspace: WorkspaceLike = None, *, target: str | None = None
) -> list[MutatorError]:
    """Return every gap and contradiction of the hazard analysis, in the order of the files.

    `target` names a manifest; default: the library's only one. MutatorError for a library without an
    analysis.
    """
    opened_workspace = open_workspace(workspace)
    analysis = _load_analysis(opened_workspace)
    manifest = opened_workspace.manifest(opened_workspace.target_name(target))
    return list_analysis_problems(analysis, opened_workspace.specs(), manifest)


def draw_control_structure(workspace: WorkspaceLike = None) -> str:
    """Draw the control structure of the hazard analysis as SVG; MutatorError for a library without one."""
    return render_structure(_load_analysis(workspace))


def doctor(workspace: "Workspace | str | PathLike[str] | MutatorError | None" = None) -> list[Finding]:
    """Check whether this machine can run campaigns: interpreter, packages, machine, library and target.

    Each finding has `name`, `level` (`ok`, `warning`, `failed`), `found`, `places` and `remedy`. `workspace`
    can be the error raised by the search for a library.
    """
    if isinstance(workspace, MutatorError):
        return examine_machine(workspace)
    try:
        opened_workspace = open_workspace(workspace)
    except MutatorError as error:
        return examine_machine(error)
    return examine_machine(opened_workspace)


def _load_analysis(workspace: WorkspaceLike) -> HazardAnalysis:
    opened_workspace = open_workspace(workspace)
    analysis = opened_workspace.analysis()
    if analysis is None:
        raise MutatorError(
            "no control_structure.yaml",
            where=opened_workspace.library / "stpa",
            expected="a hazard analysis",
            remedy="write one (see docs/explanation/hazard-analysis.md); campaigns do not need it",
        )
    return analysis
