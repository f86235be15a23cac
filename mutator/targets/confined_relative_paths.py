"""Paths from data files: relative, and confined to their folder."""

from pathlib import PurePosixPath

from mutator.errors import MutatorError


def clean_relative_path(path: str) -> str:
    """Return `path` as a clean relative path in a target's root; MutatorError, without a file position, if it
    is outside the root.
    """
    pure = PurePosixPath(path)
    if not path or pure.is_absolute() or ".." in pure.parts or "\\" in path or "\0" in path:
        raise MutatorError(
            f"path '{path}' leads out of the target",
            expected="a path relative to the target's root, without `..`",
            remedy="name a file inside the target",
        )
    return pure.as_posix()
