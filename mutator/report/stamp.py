"""What a report was made from, so that resuming a complete run does not draw it all again."""

from pathlib import Path
from typing import Any

from mutator._common.files import read_json, write_json
from mutator._common.hashing import digest
from mutator._common.version import VERSION
from mutator.errors import MutatorError
from mutator.outcomes.reader import Results
from mutator.review import gate
from mutator.store import digests
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import HEAD
from mutator.verification import equivalence
from mutator.workspace import Workspace

SCHEMA = "report/1"
FILE = "made_from.json"


def made_from(folder: RunFolder, workspace: Workspace | None) -> str:
    """Digest of all that a report depends on: results, run.json, records, timings, proof, reviews,
    pictures that it shows, what the library cites, and mutator's own sources."""
    run = folder.path
    plots = sorted(path.name for path in (run / "plots").glob("*"))
    references = _files(workspace.library / "references", "*.yaml") if workspace else None
    sources = Path(__file__).parents[1]
    own = [VERSION, _files(sources, "**/*.py"), _files(sources / "web", "*.*")]
    results = [digest((run / HEAD).read_bytes()), digest(Results.of_run(run).csv())]
    # The records, too: what the proof compares is more of them than the results have.
    engine = [_files(run / name, "*.jsonl") for name in ("records", "timings", equivalence.FOLDER)]
    sealed = [_files(run, name) for name in (gate.FILE, digests.FILE)]
    return digest([SCHEMA, own, results, engine, plots, references, *sealed])


def read_stamp(out: Path) -> dict[str, Any]:
    """What the report in `out` says it was made from; empty when there is none, or one cut short."""
    try:
        return read_json(out / FILE, SCHEMA)
    except MutatorError:  # whatever is wrong with it: the report can be written again
        return {}


def is_of(stamp: dict[str, Any], out: Path, made_from: str) -> bool:
    """Whether the report in `out` with this stamp was made from `made_from` and knows its series."""
    return bool(stamp) and (stamp["made_from"], stamp.get("series")) == (made_from, _series(out))


def write_stamp(out: Path, made_from: str, rows: int) -> None:
    """Say what the report in `out` was made from and of how many experiments it tells; last of its files."""
    stamp = {"schema": SCHEMA, "made_from": made_from, "rows": rows, "series": _series(out)}
    write_json(out / FILE, stamp)


def _series(out: Path) -> list[str]:
    """The series beside the page. Writing a report writes some, so they are what it says of itself last."""
    return sorted(path.name for path in (out / "series").glob("*.js"))


def remove_stamp(out: Path) -> None:
    """Before anything of the report is written: one that is cut short is no report."""
    (out / FILE).unlink(missing_ok=True)


def _files(folder: Path, pattern: str) -> list[tuple[str, str]]:
    return sorted((p.relative_to(folder).as_posix(), digest(p.read_bytes())) for p in folder.glob(pattern))
