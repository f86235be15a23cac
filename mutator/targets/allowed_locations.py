"""Check whether a fault may be injected at a place in a target."""

from mutator.errors import MutatorError
from mutator.model import FaultLocation
from mutator.targets.confined_relative_paths import clean_relative_path
from mutator.targets.manifest import TargetManifest
from mutator.targets.source_tree import matches_any_glob


def check_location_allowed(manifest: TargetManifest, location: FaultLocation) -> None:
    check_file_allowed(manifest, location.path)


def check_file_allowed(manifest: TargetManifest, name: str) -> None:
    """Raise MutatorError, without a file position, unless faults may be injected into the file."""
    path = clean_relative_path(name)
    if path != name or not path.endswith(".py") or path not in manifest.tree.files:
        raise MutatorError(
            f"no Python file '{name}' in target {manifest.name}",
            expected="a path relative to the target's root, among the manifest's files",
            remedy=f"correct the path, or the `files` of {manifest.path.name}",
        )
    if path in manifest.tree.overlaid_paths:
        raise MutatorError(
            f"file '{path}' is in the overlay of target {manifest.name}",
            expected="a file of the controller, because no fault may be injected into the overlay",
            remedy="inject somewhere else",
        )
    if matches_any_glob(path, manifest.forbidden_globs):
        raise MutatorError(
            f"no fault may be injected into file '{path}'",
            expected=f"a file that `forbid` of {manifest.path.name} does not match",
            remedy="inject somewhere else",
        )
