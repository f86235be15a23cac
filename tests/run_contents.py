"""What a run folder says, to compare two runs."""

from collections import Counter
from pathlib import Path

import mutator


def run_modes(out: Path) -> Counter[str]:
    return Counter(str(line["engine"]) for line in mutator.load_run(out).folder.timings().values())


def run_contents(out: Path) -> dict[str, object]:
    """Return everything that a run found out."""
    run = mutator.load_run(out)
    folder = run.folder
    return {
        "records": dict(folder.records()),
        "proof": dict(folder.records("proof")),
        "patches": {name: folder.patches.read_patch(name) for name in folder.records()},
        "results": (out / "results.csv").read_bytes(),
        "series": {p.name: p.read_bytes() for p in (out / "series").rglob("*") if p.is_file()},
        "seal": run.seal,
    }
