"""Run a campaign: plan if needed, check, run what lacks a record, build the table.

`mutator run` and `pytest --campaign FILE --campaign-out DIR -n N` are this same code: `run` starts pytest in
this process with the plugin of `mutator.pytest_plugin`.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mutator.plan import Choices
from mutator.records import Progress
from mutator.results import Results
from mutator.workspace import Workspace


@dataclass(frozen=True, kw_only=True)
class Summary:
    """What a run came to. `outcomes` as in Progress; `harness_errors` are (experiment id, detail) pairs."""

    planned: int
    done: int
    ran: int  # in this session
    outcomes: Counter[str]
    harness_errors: tuple[tuple[str, str], ...]
    problem: str  # empty, or why the session ended early (disk full, a worker died)
    interrupted: bool
    results: Results | None
    elapsed_s: float

    @property
    def exit_code(self) -> int:
        """0 fine; 3 harness errors or experiments left; 130 interrupted."""
        raise NotImplementedError


def run(
    workspace: Workspace,
    campaign: str | Path,
    out: Path,
    *,
    workers: int = 0,
    choices: Choices | None = None,
    notify: Callable[[Progress], None] | None = None,
) -> Summary:
    """Run or resume the campaign in the run folder `out` with `workers` processes (0: in this process).

    A frozen plan in `out` is used as it is: `choices` not given are the frozen ones, different ones are a
    MutatorError, as is a changed campaign file or target. `notify` is called from another thread about
    twice a second. MutatorError for wrong input, CheckFailed when the checks before the campaign fail.
    """
    raise NotImplementedError
