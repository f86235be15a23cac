"""Unified diffs for reading: what a fault changes, without the probe that every mutant gets."""

import re

_NEW_FILE = re.compile(r"^\+\+\+ b/(.+?)\t?$", re.MULTILINE)


def readable(patch: str) -> tuple[str, str]:
    """The patch without its new files, and a sentence on what was left out (empty if nothing was)."""
    sections = re.split(r"^(?=diff --git )", patch, flags=re.MULTILINE)
    kept = [s for s in sections if "\nnew file mode " not in s]
    left_out = [m[1] for s in sections if s not in kept and (m := _NEW_FILE.search(s))]
    note = f"not shown: {', '.join(left_out)}, the probe, which every mutant gets" if left_out else ""
    return "".join(kept), note
