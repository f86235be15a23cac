"""Whether a target's tree has many files that no run loads, which each run copies and compiles."""

from collections.abc import Collection, Iterator

from mutator.checks.check_findings import CheckState, Finding

_MIN_FILES = 200  # copying fewer takes no noticeable time
_MOST_GLOBS = 12  # more are no simplification


def unloaded_files_findings(tree_files: Collection[str], loaded_files: Collection[str]) -> Iterator[Finding]:
    """Yield a finding with narrower `files` if fault-free runs load less than half of a large tree's modules.

    Paths are relative to the tree.
    """
    modules = [path for path in tree_files if path.endswith(".py")]
    loaded = sorted(set(loaded_files).intersection(modules))
    if len(modules) < _MIN_FILES or not loaded or len(loaded) > len(modules) / 2:
        return
    globs = _globs_for(loaded)
    yield Finding(
        name="files",
        level=CheckState.WARN,
        found=f"fault-free runs load {len(loaded)} of {len(modules)} Python files, and each run copies all",
        remedy=f"if faulty runs need no others, nor data elsewhere: `files: [{', '.join(globs)}]` in the "
        "manifest",
    )


def _globs_for(paths: list[str]) -> list[str]:
    """Return globs over the folders of these files, shortened from the deepest folders upwards."""
    folders = {tuple(path.split("/")[:-1]) for path in paths}
    depth = max(map(len, folders))
    while depth > 1 and len({folder[:depth] for folder in folders}) > _MOST_GLOBS:
        depth -= 1
    globs = {
        "/".join(folder[:depth]) + ("/**" if len(folder) >= depth else "/*") for folder in folders if folder
    }
    return [*sorted(globs), *sorted(path for path in paths if "/" not in path)]
