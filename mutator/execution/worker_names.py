"""Names of workers, which make the names of their files in a run folder unique."""

import re
from itertools import chain
from pathlib import Path

from mutator.store.records import LINE_SCHEMA_BY_FOLDER


def new_worker_prefix(run: Path) -> str:
    """Return a prefix such as `0002-` that the workers of no earlier session had."""
    files = chain.from_iterable((run / kind).glob("*.jsonl") for kind in LINE_SCHEMA_BY_FOLDER)
    used_numbers = [int(number[0]) for path in files if (number := re.match(r"\d+", path.name))]
    return f"{max(used_numbers, default=0) + 1:04d}-"


def unused_worker_name(run: Path, name: str) -> str:
    """Return `name`, or `name` with a number, such that no worker has a file of that name."""
    used = {path.stem for kind in LINE_SCHEMA_BY_FOLDER for path in (run / kind).glob("*.jsonl")}
    names = (f"{name}{number}" for number in ("", *range(2, len(used) + 3)))
    return next(unused for unused in names if unused not in used)
