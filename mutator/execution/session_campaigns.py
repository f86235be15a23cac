"""Makes the campaigns of a user's pytest session, and registers their controller."""

import os
from contextlib import nullcontext
from pathlib import Path
from pkgutil import resolve_name

import pytest

from mutator.campaigns.campaign_files import load_campaign
from mutator.defences.defence_facts import set_name
from mutator.errors import MutatorError
from mutator.execution.campaign_items import key_in_file
from mutator.execution.campaign_runs import CampaignOptions, CampaignRun, FileRun
from mutator.execution.defended_campaign_runs import DefendedCampaignRun
from mutator.execution.distributor_choice import Distributor, choose_distributor, packages_of_distributor
from mutator.execution.progress_text import ProgressLines
from mutator.execution.regression_runs import RegressionRun
from mutator.execution.requested_campaigns import RequestedCampaigns, is_regression_file
from mutator.execution.xdist_controller import ClusterController, StandaloneController
from mutator.store.run_progress import ProgressCallback
from mutator.workspace import Workspace

# made of what is built on benches, so it is named here, and not imported
_EXPLORATION_RUN = "mutator.api.exploration_items:ExplorationRun"
_LIBRARY_PARTS = ("campaigns", "targets")  # folders of a library


def register_campaigns(config: pytest.Config, requested: RequestedCampaigns) -> None:
    """Register the controller of the session's campaigns; UsageError for a mistake in the command."""
    if getattr(config.option, "dist", "no") == "each":
        raise pytest.UsageError(
            "--dist each with a campaign: expected workers that share the experiments; use load or loadgroup"
        )
    try:
        distributor = _cluster_distributor(config)
        runs = _campaign_runs(config, requested, distributor)
    except MutatorError as err:
        raise pytest.UsageError(str(err)) from None
    is_alone = config.getoption("campaign") is not None
    controller = (
        ClusterController(runs, distributor, is_alone=is_alone)
        if distributor
        else StandaloneController(runs, is_alone=is_alone)
    )
    config.pluginmanager.register(controller)
    config.addinivalue_line("markers", "mutator: an experiment of a fault injection campaign")


def _cluster_distributor(config: pytest.Config) -> Distributor | None:
    cluster, is_insecure = config.getoption("campaign_cluster"), config.getoption("insecure_network")
    if cluster and getattr(config.option, "numprocesses", None):
        raise pytest.UsageError("--campaign-cluster with -n: leave out -n (the cluster has its own workers)")
    return choose_distributor(cluster, insecure=is_insecure) if cluster or is_insecure else None


def _campaign_runs(
    config: pytest.Config, requested: RequestedCampaigns, distributor: Distributor | None
) -> dict[str, FileRun]:
    workspace = _workspace(requested, sandbox=config.getoption("campaign_sandbox"))
    files = [workspace.campaign(requested.name)] if requested.name else list(requested.files)
    out = config.getoption("campaign_out")
    if out is not None and len(files) > 1:
        raise pytest.UsageError(
            f"--campaign-out {out} with {len(files)} campaigns: leave it out, or name one"
        )
    options = CampaignOptions(
        reviewed=config.getoption("require_reviewed"),
        accept_versions=config.getoption("accept_versions"),
        reuse=not config.getoption("campaign_no_reuse"),
        hazard_fails=config.getoption("hazard_fails"),
        workers=getattr(config.option, "numprocesses", None) or 0,
        packages=packages_of_distributor(distributor) if distributor else (),
        cluster=config.getoption("campaign_cluster"),
        insecure_network=config.getoption("insecure_network"),
    )
    notify = _progress_notifier(config)
    runs: dict[str, FileRun] = {}
    for file in files:
        path = file.resolve() if is_regression_file(file) else workspace.campaign(file).resolve()
        kind = RegressionRun if is_regression_file(file) else _kind_of_campaign(path)
        run = runs[os.path.realpath(file)] = kind(path, workspace, options, out=out, notify=notify)
        if isinstance(run, CampaignRun):
            for names in _defence_sets(path):
                key = key_in_file(os.path.realpath(file), set_name(names))
                runs[key] = DefendedCampaignRun(run, names, workspace, options, notify=notify)
    return runs


def _defence_sets(path: Path) -> tuple[tuple[str, ...], ...]:
    try:
        return load_campaign(path).defence_sets
    except MutatorError:  # collecting the file names its mistake
        return ()


def _kind_of_campaign(path: Path) -> type[FileRun]:
    try:
        explores = load_campaign(path).exploration_request is not None
    except MutatorError:  # collecting the file names its mistake
        explores = False
    kind: type[FileRun] = resolve_name(_EXPLORATION_RUN) if explores else CampaignRun
    return kind


def _workspace(requested: RequestedCampaigns, *, sandbox: bool) -> Workspace:
    library = requested.library
    if library is None and requested.files:
        folder = requested.files[0].resolve().parent
        if all((folder.parent / part).is_dir() for part in _LIBRARY_PARTS) and folder.name == "campaigns":
            library = folder.parent
    return Workspace.find(library=library, target=requested.target, sandbox=sandbox)


def _progress_notifier(config: pytest.Config) -> ProgressCallback | None:
    """Return what writes the stages before and after the items, in a session that is not quiet."""
    if config.get_verbosity() < 0:
        return None

    def write(line: str) -> None:
        reporter = config.pluginmanager.get_plugin("terminalreporter")
        capture = config.pluginmanager.get_plugin("capturemanager")
        if reporter is not None:
            # the checks run within the first item, whose output pytest captures
            with capture.global_and_fixture_disabled() if capture else nullcontext():
                reporter.ensure_newline()
                reporter.write_line(line)

    return ProgressLines(write)
