"""Digests of a report's inputs and files, so that resuming a complete run does not rewrite the report."""

from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from mutator._common.confined_files import (
    checked_relative_path,
    files_inside,
    read_below,
    unlink_below,
    write_below,
)
from mutator._common.files import json_bytes, parse_json_object
from mutator._common.folder_locks import OWNER_LOCK_FILE
from mutator._common.hashing import digest
from mutator._common.library_and_run_folder_search import SCRATCH_FOLDER
from mutator._common.version import VERSION
from mutator.errors import MutatorError
from mutator.report.panel import REPORT_FOLDER
from mutator.report.series_for_report_page import series_facts_for_page
from mutator.store import file_digests
from mutator.store import time_series_folder as series_store
from mutator.store.allowed_contents import (
    DAMAGED_FOLDER,
    DEFENDED_FOLDER,
    SIGNATURE_FILES,
    TRACES_FOLDER,
    is_allowed_top_name,
)
from mutator.store.run_folder import RunFolder
from mutator.store.session_progress import PROGRESS_FILE
from mutator.workspace import Workspace

STAMP_SCHEMA = "report/1"
STAMP_FILE = f"{REPORT_FOLDER}/made_from.json"
_TOP_NAMES_NOT_READ = {
    REPORT_FOLDER,
    "exports",
    series_store.SERIES_FOLDER,
    TRACES_FOLDER,
    DAMAGED_FOLDER,
    SCRATCH_FOLDER,
    "workers",
    OWNER_LOCK_FILE,  # has the number of the last process
    PROGRESS_FILE,
    *SIGNATURE_FILES,
}
_ASSET_SUFFIXES = (".css", ".html", ".js", ".txt")
_SUFFIXES_WITHOUT_DIGEST = (".mp4", ".gif")  # the report contains only the names of such files


def inputs_digest(folder: RunFolder, workspace: Workspace | None) -> str:
    """Return the digest of all inputs of a report, including the sources of mutator."""
    run = folder.path
    series = [
        series_facts_for_page(folder),
        file_digests.sha256_of_file(run / series_store.SERIES_FOLDER / f"{series_store.INDEX_NAME}.js"),
    ]
    return digest(
        [
            STAMP_SCHEMA,
            _mutator_digests(),
            run.name,
            list(_input_file_digests(run)),
            series,
            _library_digests(folder, workspace),
        ]
    )


def is_report_current(run: Path, inputs: str) -> bool:
    """Whether the report of a run was made from these inputs and has not changed since."""
    stamp = _read_stamp(run)
    if stamp.get("made_from") != inputs or not stamp["files"]:
        return False
    try:
        return all(
            digest(read_below(run, f"{REPORT_FOLDER}/{name}")) == expected
            for name, expected in stamp["files"].items()
        )
    except (OSError, MutatorError):
        return False


def write_report_files(run: Path, inputs: str, files: Mapping[str, bytes]) -> None:
    """Write a report and its digests. Delete files of the report before that are no longer part of it."""
    for name in _read_stamp(run)["files"].keys() - files.keys():
        unlink_below(run, f"{REPORT_FOLDER}/{name}")
    for name, data in files.items():
        write_below(run, f"{REPORT_FOLDER}/{name}", data)
    digests_by_name = {name: digest(data) for name, data in sorted(files.items())}
    stamp = {"schema": STAMP_SCHEMA, "made_from": inputs, "files": digests_by_name}
    write_below(
        run, STAMP_FILE, json_bytes(stamp)
    )  # last, so that an interrupted report does not pass as current


def _read_stamp(run: Path) -> dict[str, Any]:
    """Return the stamp of the report before; without files if it cannot be read."""
    try:
        stamp = parse_json_object(read_below(run, STAMP_FILE), run / STAMP_FILE, STAMP_SCHEMA)
        if isinstance(files := stamp.get("files"), dict):
            for name in files:
                checked_relative_path(name, run / STAMP_FILE)
            return stamp
    except (OSError, MutatorError):
        pass
    return {"files": {}}


@cache
def _mutator_digests() -> object:
    root = Path(__file__).parents[1]
    return [
        VERSION,
        _matching_digests(root, "**/*.py"),
        *(_matching_digests(root / "web", f"*/*{suffix}") for suffix in _ASSET_SUFFIXES),
    ]


def _input_file_digests(run: Path) -> Iterator[tuple[str, str]]:
    """Yield the names and digests of the files that a report can read. What does not belong in a run folder
    is not opened.
    """
    tops = [
        top
        for top in sorted(run.iterdir())
        if top.name not in _TOP_NAMES_NOT_READ and is_allowed_top_name(top.name)
    ]
    for top in tops:
        inside = sorted(top.rglob("*")) if top.is_dir() else [top]
        for path in (path for path in inside if not path.is_dir() and not path.name.startswith(".")):
            name = path.relative_to(run).as_posix()
            if top.name == DEFENDED_FOLDER and _TOP_NAMES_NOT_READ.intersection(name.split("/")[2:3]):
                continue
            yield name, "" if path.suffix in _SUFFIXES_WITHOUT_DIGEST else file_digests.sha256_of_file(path)


def _library_digests(folder: RunFolder, workspace: Workspace | None) -> object:
    """Return the digests of what a report reads of a library and of the run's target."""
    if workspace is None:
        return None
    files: list[tuple[str, str]] = []
    try:
        paths = files_inside(workspace.library, "", "*.yaml")
        files += [
            file for file in _digests_by_name(workspace.library, paths) if not file[0].startswith("reviews/")
        ]
        return [files, workspace.manifest_of(folder.head).tree.digest]
    except (MutatorError, KeyError):
        return [files, None]


def _matching_digests(folder: Path, pattern: str) -> list[tuple[str, str]]:
    return _digests_by_name(folder, folder.glob(pattern))


def _digests_by_name(folder: Path, paths: Iterable[Path]) -> list[tuple[str, str]]:
    return sorted((p.relative_to(folder).as_posix(), file_digests.sha256_of_file(p)) for p in paths)
