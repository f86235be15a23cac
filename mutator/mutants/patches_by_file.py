"""Reads patches file by file, without the probe that every mutant has."""

import re
from collections.abc import Iterator

_NEW_PATH_PATTERN = re.compile(r"^\+\+\+ b/(.+?)\t?$", re.MULTILINE)  # a tab ends a path that has a space


def patch_without_new_files(patch: str) -> tuple[str, str]:
    """Return the patch without its new files, and a sentence that names them (empty if there are none)."""
    sections = list(split_into_file_patches(patch))
    left_out = [m[1] for s in sections if adds_file(s) and (m := _NEW_PATH_PATTERN.search(s))]
    note = f"not shown: {', '.join(left_out)}, the probe, which evaluates the trigger" if left_out else ""
    return "".join(s for s in sections if not adds_file(s)), note


def split_into_file_patches(patch: str) -> Iterator[str]:
    begin = 0
    while begin < len(patch):
        end = patch.find("\ndiff --git ", begin) + 1 or len(patch)
        yield patch[begin:end]
        begin = end


def adds_file(file_patch: str) -> bool:
    return file_patch.startswith("new file mode ", file_patch.find("\n") + 1)
