"""The pytest plugin that runs campaigns: `pytest --campaign FILE --campaign-out DIR -n 2`.

Every pytest session in the environment loads this plugin, so it imports the harness only for a campaign.
"""

from pathlib import Path

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("mutator", "fault injection campaigns")
    group.addoption(
        "--campaign",
        metavar="FILE",
        help="run this campaign (a file, or a name in the fault library) instead of tests",
    )
    group.addoption(
        "--campaign-out",
        metavar="DIR",
        type=Path,
        help="the run folder; an interrupted run resumes there",
    )
    group.addoption(
        "--require-reviewed",
        action="store_true",
        help="refuse to run anything that is not approved by `mutator review`",
    )
    group.addoption(
        "--accept-versions",
        action="store_true",
        help="resume even if Python or packages have changed since the run folder was last used",
    )
    group.addoption(
        "--campaign-no-reuse",
        action="store_true",
        help="run every experiment, even if an earlier run had it, like `mutator run --no-reuse`",
    )
    group.addoption(
        "--campaign-sandbox",
        action="store_true",
        help="run the target's code in a sandbox, like `mutator run --sandbox`",
    )
    group.addoption(
        "--campaign-cluster",
        metavar="WHERE",
        help="use the workers of a Dask cluster, like `mutator run --cluster`",
    )
    group.addoption(
        "--insecure-network",
        action="store_true",
        help="use a scheduler that others on the network can reach",
    )


def pytest_configure(config: pytest.Config) -> None:
    campaign, out = config.getoption("campaign"), config.getoption("campaign_out")
    if campaign is None:
        if out is not None:
            raise pytest.UsageError("--campaign-out without --campaign")
        others = ("require_reviewed", "accept_versions", "campaign_no_reuse", "campaign_sandbox")
        for option in (*others, "campaign_cluster", "insecure_network"):
            if config.getoption(option):
                raise pytest.UsageError(f"--{option.replace('_', '-')} without --campaign")
        return
    if out is None:
        raise pytest.UsageError("--campaign needs --campaign-out DIR, the folder for its results")
    if hasattr(config, "workerinput"):
        from mutator.execution.xdist_worker import WorkerPlugin

        config.pluginmanager.register(WorkerPlugin(config, config.workerinput))
        return
    from mutator.errors import MutatorError
    from mutator.execution.distributor_choice import choose_distributor, packages_of_distributor
    from mutator.execution.xdist_controller import register_controller

    cluster, insecure = config.getoption("campaign_cluster"), config.getoption("insecure_network")
    if cluster and getattr(config.option, "numprocesses", None):
        raise pytest.UsageError("--campaign-cluster with -n: leave out -n (the cluster has its own workers)")
    try:
        work_distributor = choose_distributor(cluster, insecure=insecure) if cluster or insecure else None
    except MutatorError as err:
        raise pytest.UsageError(str(err)) from None
    register_controller(
        config,
        campaign,
        out,
        reviewed=config.getoption("require_reviewed"),
        accept_versions=config.getoption("accept_versions"),
        sandbox=config.getoption("campaign_sandbox"),
        reuse=not config.getoption("campaign_no_reuse"),
        distributor=work_distributor,
        packages=packages_of_distributor(work_distributor) if work_distributor else (),
    )
