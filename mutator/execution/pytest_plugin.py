"""The pytest plugin that collects campaigns: `pytest fault_library/campaigns/quickstart.yaml -n 2`.

Every pytest session in the environment loads this plugin, so it imports the harness only for a campaign.
"""

from pathlib import Path
from typing import Any

import pytest

from mutator.execution.requested_campaigns import WORKER_INPUT_KEY, find_requested_campaigns

_CAMPAIGN_OPTIONS = (
    "campaign_out",
    "require_reviewed",
    "accept_versions",
    "campaign_no_reuse",
    "campaign_sandbox",
    "campaign_cluster",
    "insecure_network",
    "hazard_fails",
)


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
        help="the run folder; an interrupted run resumes there (default: one below the cache; after an edit "
        "of library or target, another one)",
    )
    group.addoption(
        "--hazard-fails",
        action="store_true",
        help="fail an experiment that reaches a hazard, whatever the campaign expects",
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
    worker_input: dict[str, Any] | None = getattr(config, "workerinput", None)
    if worker_input is not None:
        if WORKER_INPUT_KEY in worker_input:
            from mutator.execution.xdist_worker import WorkerPlugin

            config.pluginmanager.register(WorkerPlugin(config, worker_input))
        return
    requested = find_requested_campaigns(config)
    if requested.is_empty:
        # options in a project's settings are for those of its sessions that have a campaign
        given_names = {str(argument).partition("=")[0] for argument in config.invocation_params.args}
        for option in _CAMPAIGN_OPTIONS:
            name = f"--{option.replace('_', '-')}"
            if name in given_names:
                raise pytest.UsageError(f"{name} without a campaign (--campaign, or a campaign's file)")
        return
    from mutator.execution.session_campaigns import register_campaigns

    register_campaigns(config, requested)
