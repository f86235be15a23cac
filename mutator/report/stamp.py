"""Digests of a report's inputs and files, so that resuming a complete run does not rewrite the report."""

from pathlib import Path

from mutator._common.files import read_json, write_json
from mutator._common.hashing import digest
from mutator._common.version import VERSION
from mutator.errors import MutatorError
from mutator.outcomes.reader import Results
from mutator.report.series import series_facts
from mutator.review import gate
from mutator.store import digests
from mutator.store import series as series_store
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import HEAD
from mutator.verification import equivalence
from mutator.workspace import Workspace

SCHEMA = "report/1"
FILE = "made_from.json"


def made_from(folder: RunFolder, workspace: Workspace | None) -> str:
    """The digest of all inputs of a report, including the sources of mutator."""
    run = folder.path
    plots = sorted(path.name for path in (run / "plots").glob("*"))
    series = [series_facts(folder), _files(run, f"{series_store.FOLDER}/{series_store.INDEX}.js")]
    references = _files(workspace.library / "references", "*.yaml") if workspace else None
    sources = Path(__file__).parents[1]
    own = [VERSION, _files(sources, "**/*.py"), _files(sources / "web", "*.*")]
    results = [digests.sha256(run / HEAD), digests.sha256(Results.of_run(run).path)]
    # Records are inputs because the equivalence check compares more than the results contain.
    engine = [_files(run / name, "*.jsonl") for name in ("records", "timings", equivalence.FOLDER)]
    sealed = [_files(run, name) for name in (gate.FILE, digests.FILE)]
    return digest([SCHEMA, own, results, engine, plots, series, references, *sealed])


def is_current(out: Path, made_from: str) -> bool:
    """Whether the report in `out` was made from these inputs and has not changed since."""
    try:
        stamp = read_json(out / FILE, SCHEMA)
    except MutatorError:  # unreadable, so the report is written again
        return False
    return (stamp.get("made_from"), stamp.get("files")) == (made_from, _written(out))


def write_stamp(out: Path, made_from: str) -> None:
    """Record the digests. Call this last."""
    write_json(out / FILE, {"schema": SCHEMA, "made_from": made_from, "files": _written(out)})


def _written(out: Path) -> dict[str, str]:
    paths = {path.relative_to(out): path for path in out.rglob("*") if path.is_file()}
    return {
        name.as_posix(): digest(path.read_bytes())
        for name, path in sorted(paths.items())
        if name.as_posix() != FILE and not name.parts[0].startswith("compare-")
    }


def remove_stamp(out: Path) -> None:
    """Remove the stamp, so that an interrupted report does not pass as complete."""
    (out / FILE).unlink(missing_ok=True)


def _files(folder: Path, pattern: str) -> list[tuple[str, str]]:
    return sorted((p.relative_to(folder).as_posix(), digests.sha256(p)) for p in folder.glob(pattern))
