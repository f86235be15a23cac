"""The golden runs that a campaign without faults drives."""

from dataclasses import dataclass

from mutator.campaigns.bench_files import load_campaign_of_run
from mutator.errors import MutatorError
from mutator.model import ConcreteScenario
from mutator.store.golden_runs import GoldenRun
from mutator.store.plan_choices import Choices
from mutator.store.planned_scenarios import concrete_scenarios_of
from mutator.store.run_folder import RunFolder


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultFreeDrive:
    """A golden run that a campaign without faults drives; `concrete` is its scenario, if a family gave it."""

    golden_run: GoldenRun
    scenario_digest: str
    concrete: ConcreteScenario | None


def check_choices_without_faults(choices: Choices) -> None:
    """Raise MutatorError for a choice among experiments, of which a campaign without faults has none."""
    for name in ("only", "exclude", "limit", "shard"):
        if getattr(choices, name) is not None:
            raise MutatorError(
                str(getattr(choices, name)),
                argument=name,
                expected=f"no `{name}`: the campaign has no faults, and so no experiments to choose from",
                remedy="choose scenarios in the campaign: `sample` of a family",
            )


def drives_of_run(folder: RunFolder) -> tuple[FaultFreeDrive, ...]:
    """Return the drives of a campaign without faults. A canary's golden run is the last that run.json lists,
    and is one only if the campaign names its scenario.
    """
    concrete_by_name, campaign = concrete_scenarios_of(folder.path), load_campaign_of_run(folder)
    names = {*campaign.scenarios, *concrete_by_name}
    drives = []
    for run in folder.golden_runs:
        if run.scenario in names:
            concrete = concrete_by_name.get(run.scenario)
            digest = concrete.digest if concrete else folder.head.sources[f"scenario {run.scenario}"]
            drives.append(FaultFreeDrive(golden_run=run, scenario_digest=digest, concrete=concrete))
    return tuple(drives)
