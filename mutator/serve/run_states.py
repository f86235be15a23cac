"""What is happening to a run: the stage of the command that works on it, or how its last session ended."""

from collections import Counter
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from mutator._common.folder_locks import is_owner_alive
from mutator.model import Status
from mutator.results.table_reader import Results
from mutator.serve.http_responses import without_absolute_folders
from mutator.store.line_tail import LineTail
from mutator.store.records import RECORDS_FOLDER, parse_ending
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import Progress, progress_label
from mutator.store.session_progress import read_session_progress

FINISHED, RUNNING, FAILED, UNFINISHED = "finished", "running", "failed", "unfinished"
SESSION_STAGES = (
    "plan",
    "checks",
    "golden",
    "experiments",
    "proof",
    "tables",
)  # in the order in which a session does them


@dataclass(frozen=True, slots=True, kw_only=True)
class RunState:
    """`progress` is that of the session that works on the run; of a session that failed, its last one."""

    state: str
    progress: Progress | None = None
    problem: str = ""  # why the last session failed

    @property
    def is_past_experiments(self) -> bool:
        return (
            self.progress is not None
            and self.progress.stage in SESSION_STAGES[SESSION_STAGES.index("experiments") + 1 :]
        )


def state_of_run(folder: RunFolder) -> RunState:
    """Return the state of a run. A command is only seen if it runs on this machine."""
    stored = read_session_progress(folder.path)
    progress = stored.progress if stored else None
    if is_owner_alive(folder.path):
        # a finished run that is resumed has nothing left to do
        return RunState(state=FINISHED if folder.is_finished else RUNNING, progress=progress)
    if folder.is_finished:
        return RunState(state=FINISHED)
    if stored and stored.problem:
        return RunState(state=FAILED, progress=progress, problem=without_absolute_folders(stored.problem))
    return RunState(state=UNFINISHED)


def can_make_report(run: Path) -> bool:
    """Whether a report can be made: no command works on the run, and it was not killed before its tables."""
    folder = RunFolder.open_unverified(run)
    state = state_of_run(folder).state
    return state == FINISHED or (state != RUNNING and Results(folder.path).path.is_file())


def count_records(run: Path) -> dict[str, int]:
    """Count the experiments of a run without finished tables by outcome or status."""
    files = sorted((run / RECORDS_FOLDER).glob("*.jsonl"))
    return _count_records(run, tuple((path.name, path.stat().st_size) for path in files))


@lru_cache(maxsize=100)
def _count_records(run: Path, _: tuple[tuple[str, int], ...]) -> dict[str, int]:
    """Count the records. The names and sizes of the files are only keys of the cache."""
    labels: dict[str, str] = {}
    for line in LineTail(run, RECORDS_FOLDER).read_new_lines():
        try:
            ending = parse_ending(line)
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError):  # the head
            continue
        label = progress_label(ending.status, ending.outcome)
        if label != Status.HARNESS_ERROR or ending.experiment_id not in labels:
            labels[ending.experiment_id] = label
    return dict(Counter(labels.values()))
