"""Campaigns: run, resumed."""

import warnings
from pathlib import Path

from mutator._common.arguments import check_type, check_whole
from mutator.api.runs import Run
from mutator.api.selection import WorkspaceLike, open_workspace
from mutator.campaigns.plans import Choices
from mutator.execution.distribution import distributor
from mutator.execution.running import run_campaign
from mutator.execution.session import Notify, Summary
from mutator.store.run_folder import RunFolder


class IncompleteRun(UserWarning):
    """A run ended before all of its experiments had a result, or with harness errors."""


def run(
    campaign: str | Path,
    out: str | Path,
    *,
    choices: Choices | None = None,
    workers: int = 0,
    engine: str | None = None,
    reviewed: bool = False,
    accept_versions: bool = False,
    cluster: str | None = None,
    insecure_network: bool = False,
    progress: Notify | None = None,
    workspace: WorkspaceLike = None,
) -> Run:
    """Run a campaign (a name of the library or a file) into the run folder `out`, or resume it there.

    What has a result is not run again. A plan that is frozen in `out` is used as it is: choices that are not
    given are the frozen ones. `workers` is the number of processes (0: this one alone), `engine` a name of
    `mutator.engines.kinds` (None: the fastest that is worth it). With `reviewed` nothing runs that has no
    approval. With `accept_versions` a run goes on with another Python or other packages than before, which it
    notes. With `cluster` (the address of a Dask scheduler, its scheduler file, `local:N`, or a cluster file)
    the workers of that cluster do the work, and `workers` only drive the checks before it. A scheduler that
    others on the network can reach is refused, unless `insecure_network`. `progress` is called about twice a
    second, from another thread.

    `Run.summary` says what this call came to. Harness errors, a full disk or an interruption end in an
    IncompleteRun warning; the same call then goes on. MutatorError for wrong input; CheckFailed when
    something is not approved, and when the checks before the campaign or the equivalence check fail.
    """
    check_whole("workers", workers)
    if choices is not None:
        check_type("choices", choices, Choices, "mutator.Choices")
    found, place = open_workspace(workspace), Path(out)
    summary = run_campaign(
        found,
        campaign,
        place,
        workers=workers,
        choices=choices,
        engine=engine,
        reviewed=reviewed,
        accept_versions=accept_versions,
        distributor=distributor(cluster, insecure=insecure_network),
        notify=progress,
    )
    if summary.exit_code:
        warnings.warn(_what_is_left(summary), IncompleteRun, stacklevel=2)
    return Run(RunFolder.open(place), found, summary)


def _what_is_left(summary: Summary) -> str:
    parts = [f"{summary.done} of {summary.planned} experiments have a result"]
    if summary.harness_errors:
        name, detail = summary.harness_errors[0]
        parts.append(f"{len(summary.harness_errors)} harness errors, the first {name}: {detail}")
    if summary.problem:
        parts.append(summary.problem)
    if summary.interrupted:
        parts.append("interrupted")
    return "; ".join(parts) + "; the same call goes on"
