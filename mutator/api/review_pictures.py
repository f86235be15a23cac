"""Write frames before and after image effects."""

from collections.abc import Sequence
from pathlib import Path

from mutator._common.below import inside
from mutator._common.files import make_folder, write_atomic
from mutator.api.selection import WorkspaceLike, open_workspace
from mutator.review.catalogue import Group
from mutator.review.pictures import of_groups

Written = dict[str, dict[str, str]]  # by group: the file of each picture, by name


def write_pictures(
    groups: Sequence[Group], target: str, folder: Path, *, workspace: WorkspaceLike = None
) -> tuple[Written, dict[str, str]]:
    """Write `<group>-before.jpg` and one frame for each level, for each group that is an image effect. Return
    the files by group, and the value that each file shows.
    """
    found = open_workspace(workspace)
    drawn = of_groups(found, found.manifest(target), groups)
    written: Written = {}
    values: dict[str, str] = {}
    if drawn:
        make_folder(folder)
    for name, pictures in drawn.items():
        shown = {"before": ("", pictures.before)}
        shown |= {level.name: (level.label, level.after) for level in pictures.levels}
        for level, (value, data) in shown.items():
            path = inside(folder, f"{name}-{level}.jpg")
            write_atomic(path, data)
            written.setdefault(name, {})[level] = str(path)
            values[str(path)] = value
    return written, values
