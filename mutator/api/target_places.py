"""List where faults can be injected."""

from mutator.api.target_and_fault_selection import WorkspaceLike, open_workspace
from mutator.mutants.parsed_files_and_anchors import parsed_file
from mutator.mutants.possible_places import ListedPlace, places_of
from mutator.mutants.refused_places import PlaceNote, split_by_refusal
from mutator.targets.allowed_locations import check_file_allowed


def find_places(
    where: str, workspace: WorkspaceLike = None, *, target: str | None = None
) -> list[ListedPlace]:
    """Return the places where faults can be injected in a file of the target, or in a function
    (`FILE::FUNCTION`): line, anchor and fault models of each, from top to bottom.

    `find_place_notes` says what is left out. MutatorError for a file in which faults are not allowed, and for
    an unknown function.
    """
    return places_and_notes(where, workspace, target)[0]


def find_place_notes(
    where: str, workspace: WorkspaceLike = None, *, target: str | None = None
) -> list[PlaceNote]:
    """Return the functions and constants of a file or function that `find_places` leaves out, or in which a
    fault acts only once, each with line and reason: compiled functions, fields of classes that copy their
    defaults, files that another file shadows.

    MutatorError as `find_places`.
    """
    return places_and_notes(where, workspace, target)[1]


def places_and_notes(
    where: str, workspace: WorkspaceLike, target: str | None
) -> tuple[list[ListedPlace], list[PlaceNote]]:
    """Return what `find_places` and `find_place_notes` return, with the target read once."""
    opened_workspace = open_workspace(workspace)
    manifest = opened_workspace.manifest(opened_workspace.target_name(target))
    path, _, function = where.partition("::")
    check_file_allowed(manifest, path)  # a forbidden file must not even be read
    file = parsed_file(manifest.tree, path)
    places = places_of(file, opened_workspace.fault_models(), function or None)
    return split_by_refusal(manifest, file, places)
