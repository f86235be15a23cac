"""Find the served run folders at each request, summarise them, and open their files."""

import threading
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import quote

from mutator._common.confined_files import open_below, path_below
from mutator._common.folder_locks import is_owner_alive
from mutator._common.library_and_run_folder_search import RUN_HEAD_FILE, SHRUNK_FOLDER
from mutator.errors import MutatorError, NotServed, UnsafePath
from mutator.execution.progress_text import stage_title
from mutator.results.outcome_counting import count_by_outcome_or_status
from mutator.results.table_reader import Results
from mutator.serve.run_states import FINISHED, RUNNING, RunState, count_records, state_of_run
from mutator.store.file_digests import DIGESTS_FILE
from mutator.store.run_folder import RunFolder

REPORT_PAGE = "report/index.html"
# folder in a run folder -> served file types
SERVED_SUFFIXES_BY_FOLDER: Mapping[str, tuple[str, ...]] = {
    "": (".csv",),
    "plots": (".svg", ".png", ".jpg", ".mp4", ".gif"),
    "series": (".js",),
    "series/kept": (".js",),
}


@dataclass(frozen=True, slots=True, eq=False)
class ServedRuns:
    """Run folders below `roots`, also those of smallest forms there, by key: the folder's name, with `-2` and
    so on for repeated names.

    A folder keeps its key while the server lives, even after it is deleted: an open page never reads another
    run.
    """

    roots: tuple[Path, ...]
    _key_by_folder: dict[Path, str] = field(default_factory=dict, init=False)  # resolved folders
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False)

    def folders_by_key(self) -> dict[str, Path]:
        """Return the run folders by key, without links to folders elsewhere."""
        folders = [path for root in self.roots for path in _run_folders_in(root.resolve())]
        return {self.reserved_key(path): path for path in folders}

    def reserved_key(self, folder: Path) -> str:
        """Return the key of a resolved folder, which no other folder then gets. It need not exist yet."""
        with self._lock:
            if folder not in self._key_by_folder:
                self._key_by_folder[folder] = _unused_key(folder.name, self._key_by_folder.values())
            return self._key_by_folder[folder]

    def folder(self, key: str) -> Path:
        with suppress(KeyError):
            return self.folders_by_key()[key]
        raise NotServed(f"no run '{key}'", expected="one of the served runs", remedy="see the first page")

    def key_of(self, folder: Path) -> str | None:
        return next((key for key, path in self.folders_by_key().items() if path == folder.resolve()), None)

    def unplanned_folder(self, key: str) -> Path | None:
        """Return the folder with this key if a command is planning a run in it; None if there is none."""
        try:
            named = [path_below(root.resolve(), key) for root in self.roots]
        except UnsafePath:
            return None
        keyed = [folder for folder, reserved in list(self._key_by_folder.items()) if reserved == key]
        planning = filter(is_owner_alive, (*keyed, *named))
        return next((folder for folder in planning if self.reserved_key(folder) == key), None)

    @property
    def folder_for_new_runs(self) -> Path:
        return next((root for root in self.roots if not RunFolder.exists(root)), self.roots[0].parent)


def _run_folders_in(root: Path) -> list[Path]:
    if RunFolder.exists(root):
        return [root]
    try:
        inside = [
            *sorted(root.glob(f"*/{RUN_HEAD_FILE}")),
            *sorted(root.glob(f"{SHRUNK_FOLDER}/*/{RUN_HEAD_FILE}")),
        ]
    except OSError:
        return []
    folders = [head.parent for head in inside]
    return [path for path in folders if path.resolve() == path and str(path).isprintable()]


def report_address(key: str) -> str:
    return f"/runs/{quote(key, safe='')}/{REPORT_PAGE}"


def _unused_key(name: str, used_keys: Iterable[str]) -> str:
    used, number, key = set(used_keys), 1, name
    while key in used:
        number += 1
        key = f"{name}-{number}"
    return key


def live_address(key: str) -> str:
    """Return the address of the page that watches a run."""
    return f"/live/{quote(key, safe='')}"


def summarize_run(key: str, path: Path) -> dict[str, Any]:
    facts: dict[str, Any] = {"key": key, "campaign": "", "target": "", "planned": 0, "done": 0}
    facts |= {"report": report_address(key), "live": live_address(key), "changed": _last_work_time_s(path)}
    facts |= {"state": "damaged", "stage": "", "outcomes": {}, "problem": ""}
    try:
        folder = RunFolder.open_unverified(path)
        run_state = state_of_run(folder)
        facts |= {"campaign": folder.head.campaign, "target": folder.head.target}
        facts |= {"planned": folder.planned_experiment_count, "state": run_state.state}
        outcomes = _outcomes_so_far(folder, run_state)
        facts |= {"outcomes": outcomes, "done": sum(outcomes.values()), "problem": run_state.problem}
        if run_state.state == RUNNING:
            facts["stage"] = stage_title(run_state.progress) if run_state.progress else "starting"
    except MutatorError as err:
        facts["problem"] = err.got
    except (LookupError, TypeError, ValueError):
        facts["problem"] = "run.json is damaged"
    return facts


def _outcomes_so_far(folder: RunFolder, run_state: RunState) -> dict[str, int]:
    """Count the experiments of a run by outcome or status."""
    progress = run_state.progress
    if run_state.state == RUNNING and progress and progress.stage == "experiments":
        return dict(progress.outcomes)
    if run_state.state == FINISHED:
        with suppress(FileNotFoundError):
            table = Results(folder.path).path.stat()
            return _count_outcomes(folder.path, table.st_mtime_ns, table.st_size)
    return count_records(folder.path)


def _last_work_time_s(run: Path) -> float:
    """Return when a command last began or ended work on a run, in s since 1970; 0 if unknown."""
    times = []
    for name in (RUN_HEAD_FILE, DIGESTS_FILE):
        with suppress(OSError):
            times.append((run / name).stat().st_mtime)
    return max(times, default=0.0)


@lru_cache(maxsize=1000)
def _count_outcomes(run: Path, mtime_ns: int, size: int) -> dict[str, int]:
    """Count how the experiments ended. `mtime_ns` and `size` of the table are only keys of the cache."""
    return count_by_outcome_or_status(Results(run).frame("status", "outcome"))


def open_served_file(run: Path, name: str) -> BinaryIO:
    """Open a file of a run; NotServed if it is not served."""
    folder, _, last = name.rpartition("/")
    if Path(last).suffix not in SERVED_SUFFIXES_BY_FOLDER.get(folder, ()):
        raise _no_such_file()
    return open_plain_file(run, name)


def open_plain_file(root: Path, name: str) -> BinaryIO:
    """Open a file below a folder without following links; NotServed if there is no plain file."""
    try:
        return open_below(root, name)
    except (OSError, UnsafePath):
        raise _no_such_file() from None


def _no_such_file() -> NotServed:
    return NotServed("no such file", expected="a file of a report, not a link")
