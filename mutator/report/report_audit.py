"""Audit a report: build it again and compare it with the stored files."""

from collections.abc import Iterator

from mutator._common.confined_files import path_below, read_below
from mutator.errors import MutatorError
from mutator.report.change_since_run_before import stored_change
from mutator.report.panel import REPORT_FOLDER
from mutator.report.random_searches import stored_random_searches
from mutator.report.report_builder import build_report
from mutator.report.report_digests import STAMP_FILE
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

_COMPARISON_PREFIX = "compare-"  # folders of comparisons with other runs


def audit_report(folder: RunFolder, workspace: Workspace | None) -> tuple[int, Iterator[MutatorError]]:
    """Return the number of files in the report's folder, and their differences from the report that this
    version of mutator makes of the run. Comparisons with other runs are not counted.
    """
    out = folder.path / REPORT_FOLDER
    names = (path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file())
    stored = {name for name in names if not name.startswith(_COMPARISON_PREFIX)} - {
        STAMP_FILE.removeprefix(f"{REPORT_FOLDER}/")
    }
    return len(stored), _differences_from_rebuilt_report(folder, workspace, stored)


def _differences_from_rebuilt_report(
    folder: RunFolder, workspace: Workspace | None, stored: set[str]
) -> Iterator[MutatorError]:
    built = build_report(
        folder,
        workspace,
        change=stored_change(folder),
        random_searches=stored_random_searches(folder),
    ).files
    for name in sorted({*built, *stored}):
        path = path_below(folder.path / REPORT_FOLDER, name)
        if name not in built:
            yield MutatorError("not part of the report", where=path, remedy="delete it")
        elif name not in stored:
            yield MutatorError("missing", where=path, expected="a page", remedy="`mutator report` builds it")
        elif read_below(folder.path, f"{REPORT_FOLDER}/{name}") != built[name]:
            yield MutatorError(
                "differs from the page built now",
                where=path,
                expected="what this version of mutator makes of the run and the library",
                remedy="`mutator report` builds it again",
            )
