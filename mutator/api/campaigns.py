"""Run and resume campaigns."""

import warnings
from pathlib import Path

from mutator._common.argument_checks import check_type, check_whole_number
from mutator.api.runs import Run
from mutator.api.target_and_fault_selection import WorkspaceLike, open_workspace
from mutator.campaigns.campaign_files import load_campaign
from mutator.engines.engine_choice import check_engine_is_offered
from mutator.errors import IncompleteRun, MutatorError
from mutator.execution.campaign_running import run_campaign
from mutator.execution.distributor_choice import choose_distributor
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import ProgressCallback


def run(
    campaign: str | Path,
    out: str | Path,
    *,
    choices: Choices | None = None,
    workers: int = 0,
    engine: str | None = None,
    reviewed: bool = False,
    accept_versions: bool = False,
    reuse: bool = True,
    since: str | Path | None = None,
    last_failed: bool = False,
    cluster: str | None = None,
    insecure_network: bool = False,
    progress: ProgressCallback | None = None,
    workspace: WorkspaceLike = None,
) -> Run:
    """Run a campaign (a name in the library, or a file) in the run folder `out`, or resume it there.

    Experiments that have a result are not rerun. If `out` holds a frozen plan, this plan is used; its choices
    apply where you give none.

    * `workers`: number of processes; 0: only this one.
    * `engine`: `reference` or `fork`; None: the fastest for this many experiments.
    * `reviewed`: refuse to run mutants without an approval.
    * `accept_versions`: resume even if versions of Python or packages have changed, and record the change.
    * `reuse`: copy the results of experiments that earlier runs had, with the same target, faults, harness
      and versions, on this machine. A sample is proved, as for forked experiments.
    * `since`: the run folder of an earlier run. An experiment is left out if nothing that its run executed
      there has changed; its earlier record stands. Both runs need Python 3.12, on this machine.
    * `last_failed`: run only what failed in `since` or, without it, in `out`: hazards, and runs that did not
      end normally. If nothing failed, everything runs. The other experiments stay to be run.
    * `cluster`: the address of a Dask scheduler, its scheduler file, `local:N`, or a cluster file. Its
      workers run the experiments; `workers` then applies only to the checks before the campaign.
    * `insecure_network`: accept a scheduler that others on the network can reach.
    * `progress`: called about twice a second, from another thread.

    `Run.summary` describes the result. After harness errors, a full disk or an interruption, an IncompleteRun
    warning is issued; the same call then resumes the run. MutatorError for invalid input; CheckFailed if an
    approval is missing, or if the checks before the campaign or the equivalence check fail. If a golden run
    fails its check, the error names a page in the folder `report` with its replay.
    """
    check_whole_number("workers", workers)
    check_engine_is_offered(engine)
    if choices is not None:
        check_type("choices", choices, Choices, "mutator.Choices")
    _check_since(since, cluster, reuse=reuse)
    opened_workspace, folder = open_workspace(workspace), Path(out)
    loaded = load_campaign(opened_workspace.campaign(campaign))
    if loaded.exploration_request is not None:
        from mutator.api.exploring_campaigns import explore_campaign

        options = {"reviewed": reviewed, "accept_versions": accept_versions, "since": since is not None}
        return explore_campaign(
            opened_workspace,
            loaded,
            folder,
            choices=choices or Choices(),
            refused=[name for name, is_set in (options | {"last_failed": last_failed}).items() if is_set],
            workers=max(workers, 1),
            engine=engine,
            reuse=reuse,
            cluster=cluster,
            insecure_network=insecure_network,
            progress=progress,
        )
    summary = run_campaign(
        opened_workspace,
        campaign,
        folder,
        workers=workers,
        choices=choices,
        engine=engine,
        reviewed=reviewed,
        accept_versions=accept_versions,
        reuse=reuse,
        since=None if since is None else Path(since),
        last_failed=last_failed,
        distributor=choose_distributor(cluster, insecure=insecure_network),
        notify=progress,
    )
    if summary.exit_code:
        warnings.warn(summary.describe_unfinished(), IncompleteRun, stacklevel=2)
    return Run(RunFolder.open(folder), opened_workspace, summary)


def _check_since(since: str | Path | None, cluster: str | None, *, reuse: bool) -> None:
    if since is not None and cluster is not None:
        raise MutatorError(
            "`since` with `cluster`",
            argument="since",
            remedy="leave out one of them: the workers of a cluster do not have the earlier run",
        )
    if since is not None and not reuse:
        raise MutatorError(
            "`since` without `reuse`",
            argument="since",
            remedy="leave out one of them: without `reuse`, every experiment runs",
        )
