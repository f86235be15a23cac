"""A local server for reports, reviews and jobs."""

from collections.abc import Callable, Sequence
from pathlib import Path

from mutator._common.library_and_run_folder_search import RUNS_FOLDER
from mutator.api.target_and_fault_selection import WorkspaceLike, open_workspace
from mutator.errors import MutatorError
from mutator.serve.application import ServedSite
from mutator.serve.served_runs import ServedRuns
from mutator.serve.server import serve


def serve_runs(
    runs: Sequence[str | Path] = (),
    *,
    port: int = 0,
    most_parallel_jobs: int = 1,
    on_ready: Callable[[str], None],
    workspace: WorkspaceLike = None,
) -> None:
    """Serve runs (run folders, or folders of them; default: runs/) and the library's reviews, until the
    process is interrupted.

    `on_ready` is called with the address. Whoever knows the address has the user's rights. At most
    `most_parallel_jobs` jobs run at the same time. MutatorError for a missing folder, and for a port in use.
    """
    roots = tuple(map(Path, runs)) or (RUNS_FOLDER,)
    for root in roots:
        # runs/ appears with the first campaign, which can be started in the browser
        if not root.is_dir() and root != RUNS_FOLDER:
            raise MutatorError("no such folder", where=root, expected="a run folder, or a folder of them")
    site = ServedSite(
        workspace=open_workspace(workspace), runs=ServedRuns(roots), most_jobs_at_once=most_parallel_jobs
    )
    serve(site, port=port, on_ready=on_ready)
