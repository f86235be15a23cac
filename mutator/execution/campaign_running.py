"""Run a campaign: plan if needed, check, run experiments without a record, build the table of results.

`mutator run` starts pytest itself; otherwise, `pytest FILE -n N` does the same.
"""

import warnings
from pathlib import Path

from mutator.errors import MutatorWarning
from mutator.execution.distributor_choice import Distributor, packages_of_distributor
from mutator.execution.local_distributor import LocalDistributor
from mutator.execution.progress_reporting import reporting_progress
from mutator.execution.session_opening import open_session
from mutator.execution.session_summary import Summary
from mutator.execution.stray_files import StrayFiles
from mutator.store.plan_choices import Choices
from mutator.store.run_progress import ProgressCallback
from mutator.workspace import Workspace

LOCAL_DISTRIBUTOR = LocalDistributor()


def run_campaign(
    workspace: Workspace,
    campaign: str | Path,
    out: Path,
    *,
    workers: int = 0,
    choices: Choices | None = None,
    engine: str | None = None,
    reviewed: bool = False,
    accept_versions: bool = False,
    reuse: bool = True,
    since: Path | None = None,
    last_failed: bool = False,
    distributor: Distributor = LOCAL_DISTRIBUTOR,
    notify: ProgressCallback | None = None,
) -> Summary:
    """Run or resume the campaign in the run folder `out` with `workers` processes (0: in this process).

    A frozen plan in `out` is used unchanged. Omitted `choices` keep their frozen values. `engine` is a name
    in `engines.engine_kinds` (None: the fastest that pays off). With `reviewed`, only approved mutants run
    (`mutator.review.approval_gate`). Without `accept_versions`, Python and packages must not change during a
    run. Without `reuse`, experiments run even if the store of finished runs has their results. With `since`,
    a run folder, experiments are left out if nothing that they executed there has changed. With
    `last_failed`, only those run that failed in `since` or, without it, in `out`. Another thread calls
    `notify` about twice a second.

    Raises MutatorError for wrong input, choices that differ from the frozen ones, or a changed campaign file
    or target. Raises CheckFailed if an unapproved mutant would run with `reviewed`, or if a
    preflight or equivalence check fails.
    """
    with open_session(
        workspace,
        campaign,
        out,
        workers=workers,
        choices=choices or Choices(),
        engine=engine,
        reviewed=reviewed,
        accept_versions=accept_versions,
        reuse=reuse,
        since=since,
        last_failed=last_failed,
        notify=notify,
    ) as session:
        session.prepare(
            packages_of_distributor(distributor), checks_beside=isinstance(distributor, LocalDistributor)
        )
        if session.pending or session.proof:
            stray_files = StrayFiles()
            with reporting_progress(session):
                distributor.run(session)
            if remark := stray_files.remark_on_new_files():
                warnings.warn(remark, MutatorWarning, stacklevel=2)
        return session.finish()
