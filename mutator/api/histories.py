"""The history of a folder of runs."""

from pathlib import Path

from mutator.report import history
from mutator.report.history import History


def write_history(folder: str | Path) -> History:
    """Write HISTORY.md and history.html into a folder of run folders: the results of each run, and what
    changed between runs of the same plan. MutatorError if the folder holds no run with results.
    """
    return history.write_history(Path(folder))
