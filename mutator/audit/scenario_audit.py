"""Checks of a run's concrete scenarios: its experiments have them, and its families give them."""

from collections.abc import Iterator

from mutator.campaigns.bench_files import load_campaign_of_run
from mutator.campaigns.campaign_scenarios import CampaignScenarios
from mutator.campaigns.plan import Plan
from mutator.errors import MutatorError
from mutator.store.file_digests import FileDigest
from mutator.store.planned_scenarios import SCENARIOS_FILE, planned_scenarios_of
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import HEAD
from mutator.workspace import Workspace


def planned_scenario_problems(folder: RunFolder, plan: Plan) -> Iterator[MutatorError]:
    """Yield a problem for each concrete scenario with another text or other golden runs than the plan's
    experiments have, and if run.json does not have the file's digest.
    """
    file_digest = FileDigest.of_file_below(folder.path, SCENARIOS_FILE)
    stored = file_digest.sha256 if file_digest else None
    if stored != folder.head.scenarios:
        got = f"scenarios {str(folder.head.scenarios)[:16]}"
        yield MutatorError(
            got, where=folder.path / HEAD, expected=f"{str(stored)[:16]}, the digest of {SCENARIOS_FILE}"
        )
    planned = planned_scenarios_of(folder.path)
    if planned is None:
        return
    digests = {experiment.scenario: experiment.scenario_digest for experiment in plan.experiments}
    digests |= {drive.golden_run.scenario: drive.scenario_digest for drive in plan.drives}
    if plan.canary:
        digests[plan.canary.scenario] = plan.canary.scenario_digest
    yield from planned.problems(digests)
    for expected in plan.tally.planned_scenarios():
        if set(planned.by_name[expected.scenario.name].goldens) != set(expected.goldens):
            yield MutatorError(
                f"golden runs of {expected.scenario.name}",
                where=folder.path / SCENARIOS_FILE,
                expected="those that follow from the plan",
            )


def family_problems(folder: RunFolder, workspace: Workspace) -> Iterator[MutatorError]:
    """Yield a problem for each concrete scenario that its family does not give for its values, and that the
    campaign does not draw; without faults, also for each that it draws and the plan lacks.
    """
    planned = planned_scenarios_of(folder.path)
    if planned is None:
        return
    if not folder.is_bench:
        yield from _draw_problems(folder, workspace, set(planned.by_name))
    families = {name: workspace.family(name) for name in planned.families}
    for name, stored in planned.by_name.items():
        scenario, family = stored.scenario, families[stored.scenario.family]
        keys = [parameter.key for parameter in family.parameters]
        if list(scenario.values) != sorted(keys) or scenario != family.concrete(
            [scenario.values[key] for key in keys]
        ):
            yield MutatorError(
                f"scenario {name}, {scenario.label}",
                where=folder.path / SCENARIOS_FILE,
                expected=f"what {family.path} gives for its values",
            )


def _draw_problems(folder: RunFolder, workspace: Workspace, planned: set[str]) -> Iterator[MutatorError]:
    campaign, head = load_campaign_of_run(folder), folder.head
    scenarios = CampaignScenarios(workspace, campaign, workspace.manifest_of(head), head.seed)
    drawn = {name for name in scenarios.names if scenarios.digest_and_concrete(name)[1] is not None}
    missing = sorted(drawn - planned) if campaign.is_fault_free else []
    for name in [*sorted(planned - drawn), *missing]:
        yield MutatorError(
            f"scenario {name}, which the campaign {'does not draw' if name in planned else 'draws'}",
            where=folder.path / SCENARIOS_FILE,
            expected=f"the {len(drawn)} scenarios that its families give with seed {head.seed}",
        )
