"""Run a campaign: plan if needed, check, run experiments without a record, build the table of results.

`mutator run` starts pytest itself; otherwise, `pytest FILE -n N` does the same.
"""

import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from mutator.campaigns.campaign_files import load_campaign
from mutator.campaigns.defended_runs import defended_run_path, open_or_freeze_defended_run
from mutator.defences.defence_facts import set_name
from mutator.errors import MutatorWarning
from mutator.execution.distributor_choice import Distributor, packages_of_distributor
from mutator.execution.frozen_plan import open_or_freeze_run
from mutator.execution.local_distributor import LocalDistributor
from mutator.execution.progress_reporting import reporting_progress
from mutator.execution.session import Session
from mutator.execution.session_opening import open_session
from mutator.execution.session_summary import Summary
from mutator.execution.stray_files import StrayFiles
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
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

    Then the campaign runs with each of its sets of defences; the summary has theirs.

    Raises MutatorError for wrong input, choices that differ from the frozen ones, or a changed campaign file
    or target. Raises CheckFailed if an unapproved mutant would run with `reviewed`, or if a
    preflight or equivalence check fails.
    """
    choices = choices or Choices()

    def run_in(open_folder: Callable[[], RunFolder], run: Path, earlier: Path | None) -> Summary:
        with open_session(
            workspace,
            open_folder,
            run,
            workers=workers,
            engine=engine,
            accept_versions=accept_versions,
            reuse=reuse,
            since=earlier,
            last_failed=last_failed,
            notify=notify,
        ) as session:
            return _run_session(session, distributor)

    summary = run_in(
        lambda: open_or_freeze_run(workspace, campaign, out, choices, reviewed=reviewed), out, since
    )
    sets = load_campaign(workspace.campaign(campaign)).defence_sets
    if not sets or summary.interrupted or summary.problem:
        return summary
    undefended, summaries = RunFolder.open(out), dict[str, Summary]()
    for names in sets:
        earlier = defended_run_path(since, names) if since else None
        of_set = run_in(
            partial(open_or_freeze_defended_run, workspace, undefended, names),
            defended_run_path(undefended.path, names),
            earlier if earlier and RunFolder.exists(earlier) else None,
        )
        summaries[set_name(names)] = of_set
        if of_set.interrupted or of_set.problem:
            break
    return replace(summary, defended=summaries)


def _run_session(session: Session, distributor: Distributor) -> Summary:
    session.prepare(
        packages_of_distributor(distributor), checks_beside=isinstance(distributor, LocalDistributor)
    )
    if session.pending or session.proof:
        stray_files = StrayFiles()
        with reporting_progress(session):
            distributor.run(session)
        if remark := stray_files.remark_on_new_files():
            warnings.warn(remark, MutatorWarning, stacklevel=3)
    return session.finish()
