"""Keeps `progress.json` of a run folder up to date while a session works, for whoever watches the run."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mutator.store.run_progress import Progress, ProgressCallback
from mutator.store.session_progress import remove_session_progress, write_session_progress


class WatchedProgress:
    """The latest progress of a session. `problem` is why it failed without an exception."""

    def __init__(self, run: Path, notify: ProgressCallback | None) -> None:
        self.latest = Progress(stage="plan")
        self.problem = ""
        self._run = run
        self._notify = notify  # of whoever started the session

    def notify(self, progress: Progress) -> None:
        self.latest = progress
        write_session_progress(self._run, progress)
        if self._notify:
            self._notify(progress)


@contextmanager
def writing_progress(run: Path, notify: ProgressCallback | None) -> Iterator[WatchedProgress]:
    """Yield the progress of the session that works in this context. A failure leaves the file with its cause,
    unless the session was refused before any work; any other end, such as an interruption, removes it.
    """
    watched = WatchedProgress(run, notify)
    write_session_progress(run, watched.latest)
    try:
        yield watched
    except Exception as error:
        if watched.latest.stage != "plan":
            watched.problem = str(error) or type(error).__name__
        raise
    finally:
        if watched.problem:
            write_session_progress(run, watched.latest, watched.problem)
        else:
            remove_session_progress(run)
