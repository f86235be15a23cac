"""Campaigns that explore: results decide which experiments follow."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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
from mutator.campaigns.campaign_files import Campaign, load_campaign
from mutator.campaigns.campaign_scenarios import CampaignScenarios
from mutator.campaigns.exploration_section import ExplorationSection
from mutator.errors import MutatorError
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import ProgressCallback
from mutator.workspace import Workspace


@dataclass(frozen=True, kw_only=True)
class ExploringCampaign:
    """A campaign that explores, with its planes. `values` are those of the bench on which it runs."""

    workspace: Workspace
    campaign: Campaign
    selected_target: SelectedTarget
    values: Mapping[str, Any]
    section: ExplorationSection

    @classmethod
    def of_campaign(
        cls, workspace: Workspace, campaign: Campaign, *, reading: str | None = None, seed: int | None = None
    ) -> "ExploringCampaign":
        """Return the campaign with its planes; MutatorError for a fault, scenario or start that does not
        exist.
        """
        request = campaign.exploration_request
        assert request is not None
        seed = campaign.seed if seed is None else seed
        selected_target, values = bench_values(
            workspace, target=None, campaign=campaign.path, reading=reading or campaign.reading, seed=seed
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
        return cls(
            workspace=workspace,
            campaign=campaign,
            selected_target=selected_target,
            values={**values, "name": campaign.name, "about": campaign.purpose},
            section=section,
        )

    @property
    def most_runs(self) -> int:
        """The most runs of search and validations. Repairs and challengers come on top."""
        section = self.section
        if section.goal == "find":
            return section.budget
        most = section.search + section.validation
        return sum(
            min(max(1, len(plane.magnitudes)) * len(plane.durations_s), most) * plane.seeds
            for plane in section.planes
        )

    def run(
        self,
        out: Path,
        *,
        workers: int,
        engine: str | None = None,
        reuse: bool,
        cluster: str | None,
        insecure_network: bool,
        progress: ProgressCallback | None,
    ) -> Run:
        """Run it, or resume it."""
        with opened_exploration(
            self.selected_target,
            self.values,
            self.section,
            out,
            workers=workers,
            engine=engine,
            reuse=reuse,
            distributor=distributor_of_cluster(cluster, insecure_network=insecure_network),
            progress=progress,
        ) as bench:
            reading = self.values["reading"]
            if self.section.goal == "envelope":
                explore_envelopes(bench, self.section, self.selected_target, reading, within_budget(None))
            else:
                search_findings(bench, self.section, self.selected_target, reading)
        warn_of_end(bench.summary)
        return Run(RunFolder.open(out), self.workspace, bench.summary)


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
    refuse_choices(campaign, choices, refused)
    exploring = ExploringCampaign.of_campaign(workspace, campaign, reading=choices.reading, seed=choices.seed)
    return exploring.run(
        out,
        workers=workers,
        engine=engine,
        reuse=reuse,
        cluster=cluster,
        insecure_network=insecure_network,
        progress=progress,
    )


def planned_exploration(workspace: Workspace, campaign: str | Path, choices: Choices) -> ExploringCampaign:
    """Return what a campaign explores; MutatorError for choices that do not apply."""
    loaded = load_campaign(workspace.campaign(campaign))
    refuse_choices(loaded, choices)
    return ExploringCampaign.of_campaign(workspace, loaded, reading=choices.reading, seed=choices.seed)


def refuse_choices(campaign: Campaign, choices: Choices, others: Sequence[str] = ()) -> None:
    """Raise MutatorError for choices, or other given arguments, that do not apply to an exploration."""
    planned_choices = ("only", "exclude", "limit", "shard", "series_mb")
    refused = [*others, *(name for name in planned_choices if getattr(choices, name) is not None)]
    if refused:
        raise MutatorError(
            f"`{refused[0]}` for campaign {campaign.name}, which explores",
            argument=refused[0],
            expected="a campaign whose experiments can be planned",
            remedy=f"leave out `{refused[0]}`",
        )


def _scenarios_of(
    workspace: Workspace, campaign: Campaign, selected_target: SelectedTarget, seed: int
) -> list[ScenarioLike]:
    scenarios = CampaignScenarios(workspace, campaign, selected_target.manifest, seed)
    pairs = ((name, scenarios.digest_and_concrete(name)[1]) for name in scenarios.names)
    return [concrete or name for name, concrete in pairs]
