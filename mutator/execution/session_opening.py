"""Opens a session: locks the run folder, freezes the plan if needed, and clears leftovers."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path

from mutator._common.files import is_half_written, remove_anything_at
from mutator._common.folder_locks import lock_run_folder
from mutator._common.interrupts import raising_keyboard_interrupts
from mutator.campaigns.plan_freezing import make_run_folder
from mutator.errors import MutatorError
from mutator.execution.earlier_run import EarlierRunUse, open_earlier_run
from mutator.execution.session import Session
from mutator.execution.watched_progress import writing_progress
from mutator.store import file_digests
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import Progress, ProgressCallback
from mutator.workspace import Workspace


@contextmanager
def open_session(
    workspace: Workspace,
    open_folder: Callable[[], RunFolder],
    out: Path,
    *,
    workers: int,
    engine: str | None = None,
    accept_versions: bool = False,
    reuse: bool = True,
    since: Path | None = None,
    last_failed: bool = False,
    notify: ProgressCallback | None = None,
) -> Iterator[Session]:
    """Lock the run folder `out`, open it or freeze its plan with `open_folder`, and yield the session.

    Scratch folders are deleted before and after the session.
    """
    earlier = EarlierRunUse(since=open_earlier_run(since, out) if since else None, last_failed=last_failed)
    is_new = not out.exists()
    make_run_folder(out)
    with raising_keyboard_interrupts(), lock_run_folder(out):
        if notify and not RunFolder.exists(out):
            notify(Progress(stage="plan"))
        try:
            folder = open_folder()
        except MutatorError:
            if is_new and not RunFolder.exists(out):  # nothing was planned, so nothing is worth keeping
                shutil.rmtree(out, ignore_errors=True)
            raise
        file_digests.add_segments_to_ledger(folder.path)
        remove_anything_at(folder.scratch_folder)
        # where files get their names only when they are complete
        folders = ("plan", "report", "series", "patches")
        candidates = (folder.path.iterdir(), *((folder.path / name).rglob("*") for name in folders))
        for path in chain(*candidates):
            if is_half_written(path.name) and path.is_file():
                path.unlink()
        try:
            with writing_progress(folder.path, notify) as progress:
                session = Session(
                    workspace.with_scenarios_of(folder.path),
                    folder,
                    workers=workers,
                    engine=engine,
                    accept_versions=accept_versions,
                    reuse=reuse,
                    earlier=earlier,
                    notify=progress.notify,
                )
                yield session
                progress.problem = session.problem
        finally:
            remove_anything_at(folder.scratch_folder)
