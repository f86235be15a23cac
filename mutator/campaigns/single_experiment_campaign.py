"""A campaign of a single experiment: a campaign file, and a spec file of its fault beside it."""

import re
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mutator._common.confined_files import path_below
from mutator._common.files import write_atomic
from mutator.campaigns.campaign_expansion import CampaignExpansion
from mutator.campaigns.campaign_files import SCHEMA as CAMPAIGN_SCHEMA
from mutator.campaigns.campaign_files import Campaign, load_campaign
from mutator.config.yaml_writing import yaml_text
from mutator.errors import MutatorError
from mutator.faults.fault_specs import SCHEMA as SPEC_SCHEMA
from mutator.faults.fault_specs import FaultSpec
from mutator.faults.library_readings import KEY_WITHOUT_NAME
from mutator.model import OPERATOR_FAULTS_MODULE, Experiment, Hold, Trigger
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import trigger_time_s
from mutator.workspace import Workspace

_NAME = re.compile(r"[a-z][a-z0-9_]*")


def check_campaign_name(workspace: Workspace, name: str) -> None:
    """Raise MutatorError unless a campaign of the library can get this name."""
    if not _NAME.fullmatch(name):
        raise MutatorError(
            repr(name), argument="save", expected="a name of lowercase letters, digits and `_`"
        )
    for path in _files(workspace, name):
        if path.exists():
            raise MutatorError(
                "there is such a file", where=path, argument="save", remedy="choose another name"
            )


def save_single_experiment_campaign(
    workspace: Workspace,
    manifest: TargetManifest,
    experiment: Experiment,
    source: Campaign,
    injection: int | None,
    name: str,
) -> Path:
    """Write a campaign that has nothing but this experiment into the library; return its file.

    `injection` is the number of the only injection in the spec; None: all. Canary and limits are those of
    `source`. MutatorError if no campaign can have this experiment alone; nothing is then written.
    """
    check_campaign_name(workspace, name)
    _check_can_be_chosen(workspace, experiment, source)
    campaign_file, spec_file = _files(workspace, name)
    fault = experiment.fault
    spec = workspace.spec(f"{fault.module}/{fault.fault_type}")
    campaign_file.parent.mkdir(exist_ok=True)
    try:
        write_atomic(spec_file, yaml_text(_spec_data(spec, experiment, injection, name)).encode())
        data = _campaign_data(experiment, source, name, spec_file.name)
        write_atomic(campaign_file, yaml_text(data).encode())
        _check_same(workspace, manifest, campaign_file, experiment)
    except BaseException:
        campaign_file.unlink(missing_ok=True)
        spec_file.unlink(missing_ok=True)
        raise
    return campaign_file


def _check_can_be_chosen(workspace: Workspace, experiment: Experiment, source: Campaign) -> None:
    fault = experiment.fault
    spec_file = path_below(workspace.library / "faults", f"{fault.module}/{fault.fault_type}.yaml")
    reasons = {
        "a mutant of an operator cannot be chosen by name": fault.module == OPERATOR_FAULTS_MODULE,
        "a campaign cannot choose a scenario of a family by its values": experiment.concrete is not None,
        "the run has no canary": source.canary is None,
        "the library has no spec of the fault": spec_file not in workspace.spec_files(),
    }
    if reason := next((text for text, applies in reasons.items() if applies), ""):
        raise MutatorError(reason, argument="save", remedy="use the regression")


def _files(workspace: Workspace, name: str) -> tuple[Path, Path]:
    """Return the files of campaign and spec. Campaigns end in `.yaml`, so the spec ends in `.yml`."""
    folder = workspace.library / "campaigns"
    return path_below(folder, f"{name}.yaml"), path_below(folder, f"{name}.fault.yml")


def _spec_data(spec: FaultSpec, experiment: Experiment, injection: int | None, name: str) -> dict[str, Any]:
    fault = experiment.fault
    variant_name = fault.spec.rpartition("/")[2]
    variant = dict(spec.source.data["variants"][variant_name])
    if fault.value is not None:
        variant["draw"] = _fixed_draws(variant["draw"], fault.value)
    if injection is not None:
        keys = (fault.reading or KEY_WITHOUT_NAME, *spec.readings.names)
        key = "" if "injections" in variant else next(key for key in keys if key in variant)
        place = variant[key] if key else variant
        alone = {**place, "injections": [place["injections"][injection]]}
        variant = {**variant, key: alone} if key else alone
    return {
        "schema": SPEC_SCHEMA,
        "module": fault.module,
        "fault_type": name,
        "about": spec.about,
        "variants": {variant_name: variant},
    }


def _fixed_draws(draws: Mapping[str, Any], value: Any) -> dict[str, Any]:
    """Return draws with a single value; of paired ones, the values that belong to it."""
    number = next(iter(draws.values())).get("values", [value]).index(value) if len(draws) > 1 else 0
    return {
        key: {"values": [draw["values"][number] if len(draws) > 1 else value]} for key, draw in draws.items()
    }


def _campaign_data(experiment: Experiment, source: Campaign, name: str, spec_file: str) -> dict[str, Any]:
    trigger = experiment.trigger
    data = {
        "schema": CAMPAIGN_SCHEMA,
        "name": name,
        "about": f"The smallest form of a fault: {experiment.label}.",
        "target": source.target,
        "scenarios": [experiment.scenario],
        "setting": list(experiment.setting),
        "faults": [{"spec": spec_file}],
        "reading": experiment.fault.reading or None,
        "triggers": {"list": [_listed_trigger(trigger)], "armed_after_s": trigger.armed_after_s},
        "seed": experiment.seed,
        "canary": asdict(source.canary) if source.canary else None,
        "after_hazard": experiment.after_hazard.value,
        "include": source.include.value if source.include else None,
        "limits": source.yaml_source.data.get("limits"),
    }
    return {key: value for key, value in data.items() if value not in (None, [])}


def _listed_trigger(trigger: Trigger) -> dict[str, Any]:
    time_s = trigger_time_s(trigger)
    when: dict[str, Any] = {"always": True} if trigger.hold is Hold.TO_END else {"when": trigger.condition}
    return (when if time_s is None else {"at_s": time_s}) | (
        {"hold_s": trigger.hold_s} if trigger.hold is Hold.FOR else {}
    )


def _check_same(
    workspace: Workspace, manifest: TargetManifest, campaign_file: Path, experiment: Experiment
) -> None:
    campaign = load_campaign(campaign_file)
    reading = experiment.fault.reading
    planned = CampaignExpansion(workspace, campaign, manifest, experiment.seed, reading).build_experiments()
    if [_what_runs(other) for other in planned] != [_what_runs(experiment)]:
        raise MutatorError(
            f"a campaign would not run {experiment.label} itself, but draw other random numbers",
            argument="save",
            remedy="use the regression",
        )


def _what_runs(experiment: Experiment) -> tuple[object, ...]:
    """Return what decides a run up to its first hazard: a campaign has no `end_s`, and goes on after it."""
    trigger = experiment.trigger
    return (
        experiment.fault.injections,
        experiment.fault.hold,
        experiment.changes,
        experiment.scenario_digest,
        (trigger.condition, trigger.hold, trigger.hold_s),
        experiment.seed,
        experiment.after_hazard,
    )
