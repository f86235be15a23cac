"""The canary: a fault known to be harmful. The check fails only if every value of the canary's variant is
harmless.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

from mutator.campaigns.campaign_files import Campaign
from mutator.engines.engine_jobs import Job
from mutator.errors import MutatorError
from mutator.faults.spec_expansion import expand_spec
from mutator.model import Experiment, Fault, fault_label
from mutator.mutants.mutant_building import build
from mutator.preflight.check_run_problems import CheckRun
from mutator.store.checks_file import HazardTimes, describe_golden_hazards
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

_OTHER_FAULT_REMEDY = "choose another fault, an earlier time or another scenario for `canary`"


@dataclass(frozen=True, slots=True, kw_only=True)
class CanaryVerdict:
    """Whether a canary caused its hazard: either `success`, or a `problem` with what to do about it."""

    success: str = ""
    problem: str = ""
    remedy: str = ""


def golden_hazard_error(campaign: Campaign, golden_key: str, hazards: HazardTimes) -> MutatorError:
    """Return the error of a canary whose golden run has a hazard, for the caller to raise."""
    got = (
        f"the canary's golden run {golden_key} has a hazard without any fault, "
        f"{describe_golden_hazards(hazards)}"
    )
    expected = "a scenario in which only the fault causes a hazard"
    remedy = "name another scenario for `canary`"
    if campaign.is_bench:  # its file was written for the caller
        return MutatorError(got, argument="canary", expected=expected, remedy=remedy)
    return campaign.error(("canary", "scenario"), got, expected=expected, remedy=remedy)


def canary_with_other_values(
    workspace: Workspace, manifest: TargetManifest, canary: Experiment
) -> Iterator[Experiment]:
    """Yield the canary, then the same fault with each other value of its variant, largest first."""
    yield canary
    models, canary_fault = workspace.fault_models(), canary.fault
    others: dict[str, Fault] = {}
    for spec in workspace.specs():
        if canary_fault.spec.startswith(f"{spec.name}/") and canary_fault.reading in spec.readings.names:
            faults = expand_spec(spec, canary.seed, canary_fault.reading, models=models, manifest=manifest)
            others |= {f.id: f for f in faults if f.spec == canary_fault.spec and f.id != canary_fault.id}
    for fault in sorted(others.values(), key=lambda fault: fault.size, reverse=True):
        yield replace(canary, fault=fault)


def build_canary_job(workspace: Workspace, manifest: TargetManifest, experiment: Experiment) -> Job:
    mutant = build(manifest, workspace.fault_models(), experiment.fault, experiment.trigger)
    return Job(
        name=f"canary-{experiment.id}",
        scenario=workspace.scenario(experiment.scenario),
        seed=experiment.seed,
        scenario_changes=experiment.changes,
        changed_files=mutant.files,
        mutant_id=mutant.id,
        injection_ids=mutant.injection_ids,
        ids_before_anchor=mutant.ids_before_anchor,
    )


def run_until_hazard(
    experiments: Iterable[Experiment], run: Callable[[Experiment], CheckRun], hazard: str
) -> CanaryVerdict:
    """Run experiments until one causes `hazard`.

    A fault that cannot be injected has not been tried, so the reason is then the whole problem.
    """
    harmless: list[str] = []
    refusals: list[MutatorError] = []
    for experiment in experiments:
        value = fault_label("", experiment.fault.value, experiment.fault.unit).strip()
        try:
            result = run(experiment)
            if result.problem:  # retry: a cause outside the target must not change the message
                result = run(experiment)
        except MutatorError as error:  # no mutant can be built with this value
            result = CheckRun(problem=error.got)
            refusals.append(error)
        if not result.problem and hazard in dict(result.hazards):
            others = f" with {value}, and not with {', '.join(harmless)}" if harmless else ""
            return CanaryVerdict(success=f"reached {hazard}{others}")
        harmless.append(" ".join(filter(None, (value, result.problem and f"({result.problem})"))))
    if len(refusals) == len(harmless):
        return CanaryVerdict(
            problem=f"cannot be injected: {refusals[0]}", remedy="correct the fault spec of the `canary`"
        )
    tried = ", ".join(filter(None, harmless))
    return CanaryVerdict(
        problem=f"did not reach {hazard}" + (f" with any of its values: {tried}" if tried else ""),
        remedy=_OTHER_FAULT_REMEDY,
    )
