"""Paths that come from data: relative, and never out of their folder."""

from functools import lru_cache
from pathlib import Path, PurePosixPath

from mutator.errors import MutatorError


@lru_cache(maxsize=1024)
def inside(root: Path, path: str) -> str:
    """`path` as a clean relative path below `root`; MutatorError (without place) if it leads elsewhere.

    Cached, since every injection of every mutant asks. Links that change later do not matter: a target's
    files are read once.
    """
    pure = PurePosixPath(path)
    if not path or pure.is_absolute() or ".." in pure.parts or "\\" in path or "\0" in path:
        raise _outside(path)
    resolved_root = root.resolve()
    if not (resolved_root / pure).resolve().is_relative_to(resolved_root):
        raise _outside(path)
    return pure.as_posix()


def _outside(path: str) -> MutatorError:
    return MutatorError(
        f"path '{path}' leads out of the target",
        expected="a path relative to the target's root, without `..`",
        remedy="name a file inside the target",
    )
