"""Paths that come from data: relative, never out of their folder, never where faults are forbidden."""

from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from mutator.errors import MutatorError
from mutator.model import FaultLocation
from mutator.targets.source_tree import matches

if TYPE_CHECKING:
    from mutator.targets.manifest import TargetManifest


@lru_cache(maxsize=1024)
def inside(root: Path, path: str) -> str:
    """`path` as a clean relative path below `root`; MutatorError (without place) if it leads elsewhere.

    Remembered, as each injection of each mutant asks; links that change later matter not, since what is read
    of a target is read once.
    """
    pure = PurePosixPath(path)
    if not path or pure.is_absolute() or ".." in pure.parts or "\\" in path or "\0" in path:
        raise _outside(path)
    resolved_root = root.resolve()
    if not (resolved_root / pure).resolve().is_relative_to(resolved_root):
        raise _outside(path)
    return pure.as_posix()


def check_location(manifest: "TargetManifest", location: FaultLocation) -> None:
    """MutatorError (without place) unless a fault may be injected into the location's file."""
    path = inside(manifest.root, location.path)
    if path != location.path or not path.endswith(".py") or path not in manifest.tree.files:
        raise MutatorError(
            f"no Python file '{location.path}' in target {manifest.name}",
            expected="a path relative to the target's root, among the manifest's files",
            remedy=f"correct the path, or the `files` of {manifest.path.name}",
        )
    if matches(path, manifest.forbid):
        raise MutatorError(
            f"file '{path}' is forbidden to faults",
            expected=f"a file that `forbid` of {manifest.path.name} does not match",
            remedy="inject somewhere else",
        )


def _outside(path: str) -> MutatorError:
    return MutatorError(
        f"path '{path}' leads out of the target",
        expected="a path relative to the target's root, without `..`",
        remedy="name a file inside the target",
    )
