"""Campaigns that explore: results decide which experiments follow."""

from collections.abc import Sequence
from pathlib import Path

from mutator.api.benches import bench_values, distributor_of_cluster, warn_of_end
from mutator.api.exploration_benches import (
    SEARCHED_DURATIONS,
    SEARCHED_MAGNITUDES,
    explore_envelopes,
    opened_exploration,
    search_findings,
    within_budget,
)
from mutator.api.exploration_planes import chosen_planes
from mutator.api.runs import Run
from mutator.api.scenario_choice import ScenarioLike
from mutator.api.target_and_fault_selection import SelectedTarget
from mutator.campaigns.campaign_files import Campaign
from mutator.campaigns.campaign_scenarios import CampaignScenarios
from mutator.campaigns.exploration_section import ExplorationSection
from mutator.errors import MutatorError
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import ProgressCallback
from mutator.workspace import Workspace


def explore_campaign(
    workspace: Workspace,
    campaign: Campaign,
    out: Path,
    *,
    choices: Choices,
    refused: Sequence[str],
    workers: int,
    engine: str | None,
    reuse: bool,
    cluster: str | None,
    insecure_network: bool,
    progress: ProgressCallback | None,
) -> Run:
    """Run a campaign that explores, or resume it. `refused` are given arguments that do not apply."""
    request = campaign.exploration_request
    assert request is not None
    planned_choices = ("only", "exclude", "limit", "shard", "series_mb")
    refused = [*refused, *(name for name in planned_choices if getattr(choices, name) is not None)]
    if refused:
        raise MutatorError(
            f"`{refused[0]}` for campaign {campaign.name}, which explores",
            argument=refused[0],
            expected="a campaign whose experiments can be planned",
            remedy=f"leave out `{refused[0]}`",
        )
    seed = campaign.seed if choices.seed is None else choices.seed
    selected_target, values = bench_values(
        workspace,
        target=None,
        campaign=campaign.path,
        reading=choices.reading or campaign.reading,
        seed=seed,
    )
    is_envelope = request.goal == "envelope"
    planes = chosen_planes(
        selected_target,
        [selection.spec_pattern for selection in campaign.fault_selections],
        _scenarios_of(workspace, campaign, selected_target, seed),
        request.starts,
        magnitude_count=request.points if is_envelope else SEARCHED_MAGNITUDES,
        duration_count=request.points if is_envelope else SEARCHED_DURATIONS,
        longest_s=request.longest_s,
        seed=seed,
        reading=values["reading"],
        seeds=request.seeds if is_envelope else 1,
        challengers=request.challengers if is_envelope else (),
    )
    section = ExplorationSection(
        planes=list(planes),
        goal=request.goal,
        strategy=request.strategy,
        budget=request.budget,
        observe_s=request.observe_s,
        search=request.search,
        validation=request.validation,
        batch=request.batch,
    )
    with opened_exploration(
        selected_target,
        {**values, "name": campaign.name, "about": campaign.purpose},
        section,
        out,
        workers=workers,
        engine=engine,
        reuse=reuse,
        distributor=distributor_of_cluster(cluster, insecure_network=insecure_network),
        progress=progress,
    ) as bench:
        if is_envelope:
            explore_envelopes(bench, section, selected_target, values["reading"], within_budget(None))
        else:
            search_findings(bench, section, selected_target, values["reading"])
    warn_of_end(bench.summary)
    return Run(RunFolder.open(out), workspace, bench.summary)


def _scenarios_of(
    workspace: Workspace, campaign: Campaign, selected_target: SelectedTarget, seed: int
) -> list[ScenarioLike]:
    scenarios = CampaignScenarios(workspace, campaign, selected_target.manifest, seed)
    pairs = ((name, scenarios.digest_and_concrete(name)[1]) for name in scenarios.names)
    return [concrete or name for name, concrete in pairs]
