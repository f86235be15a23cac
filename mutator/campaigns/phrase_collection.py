"""Collects the phrases of a library that the sentences about a run's experiments need."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace

from mutator.campaigns.campaign_files import Campaign
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModels
from mutator.faults.fault_specs import FaultSpec
from mutator.model import OPERATOR_FAULTS_MODULE, Experiment, Fault, Trigger
from mutator.targets.manifest import TargetManifest
from mutator.targets.stored_phrases import PhraseByCase, Phrases
from mutator.triggers.trigger_kinds import name_without_hold
from mutator.workspace import Workspace


class UsedPhraseSources:
    """The variants and fault models of the faults that a plan has, without the faults themselves."""

    def __init__(self) -> None:
        self.variants, self.models = set[str](), set[str]()

    def add(self, faults: Iterable[Fault]) -> None:
        for fault in faults:
            if fault.module != OPERATOR_FAULTS_MODULE:
                self.variants.add(fault.spec)
            self.models.update(injection.model for injection in fault.injections)


def phrases_of_campaign(
    workspace: Workspace, campaign: Campaign, manifest: TargetManifest, reading: str, used: UsedPhraseSources
) -> Phrases:
    """Return the phrases of the faults that a campaign's plan has, of its contexts, and of its target."""
    files = [selection.spec_file for selection in campaign.fault_selections if selection.spec_file]
    table = campaign.context_table
    return Phrases(
        faults=phrases_of_variants(_specs_of(workspace, used.variants, files), used.variants, reading),
        models=phrases_of_models(workspace.fault_models(), used.models),
        situations={}
        if table is None
        else _without_empty({row.id: row.phrase for row in workspace.context_table(table).rows}),
        **target_phrases(manifest),
    )


def phrases_of_fault(workspace: Workspace, manifest: TargetManifest, fault: Fault) -> Phrases:
    """Return the phrases of one fault and its target."""
    used = UsedPhraseSources()
    used.add([fault])
    return Phrases(
        faults=phrases_of_variants(_specs_of(workspace, used.variants, ()), used.variants, fault.reading),
        models=phrases_of_models(workspace.fault_models(), used.models),
        **target_phrases(manifest),
    )


def phrases_of_experiment(workspace: Workspace, manifest: TargetManifest, experiment: Experiment) -> Phrases:
    """Return the phrases of one experiment and its target."""
    phrases = phrases_of_fault(workspace, manifest, experiment.fault)
    return replace(phrases, situations=phrases_of_trigger(workspace, experiment.trigger))


def phrases_of_trigger(workspace: Workspace, trigger: Trigger) -> Mapping[str, PhraseByCase]:
    """Return the phrase of the context that a trigger is; nothing for another trigger."""
    return phrases_of_contexts(workspace, {context_key(trigger)})


def context_key(trigger: Trigger) -> tuple[str, str]:
    """Return the name and condition that a context has if the trigger is one, with or without a hold."""
    return name_without_hold(trigger.name, trigger.hold_s), trigger.condition


def phrases_of_contexts(
    workspace: Workspace, names_and_conditions: Collection[tuple[str, str]]
) -> Mapping[str, PhraseByCase]:
    """Return the phrases of the contexts among triggers, given by name and condition."""
    tables = map(workspace.context_table, workspace.context_tables)
    return _without_empty(
        {
            row.id: row.phrase
            for table in tables
            for row in table.rows
            if (row.id, row.condition) in names_and_conditions
        }
    )


def target_phrases(manifest: TargetManifest) -> dict[str, Mapping[str, PhraseByCase]]:
    return {
        "hazards": _without_empty({hazard.name: hazard.phrase for hazard in manifest.hazard_rules}),
        "actuators": _without_empty({channel.name: channel.phrase for channel in manifest.compared_channels}),
    }


def _specs_of(workspace: Workspace, variants: Collection[str], files: Iterable[object]) -> list[FaultSpec]:
    """Return the specs of variants. One that is not in the library, or no longer, has no phrase."""
    names = {variant.rpartition("/")[0] for variant in variants}
    specs = [workspace.spec(str(file)) for file in files]
    for name in sorted(names - {spec.name for spec in specs}):
        try:
            specs.append(workspace.spec(name))
        except MutatorError:
            continue
    return specs


def phrases_of_variants(
    specs: Iterable[FaultSpec], variants: Collection[str], reading: str
) -> Mapping[str, PhraseByCase]:
    phrases = {
        f"{spec.name}/{variant.name}": variant.phrase_in_reading(reading)
        for spec in specs
        for variant in spec
    }
    return _without_empty({name: phrase for name, phrase in sorted(phrases.items()) if name in variants})


def phrases_of_models(models: FaultModels, names: Collection[str]) -> Mapping[str, PhraseByCase]:
    return _without_empty({model.name: model.phrase for model in models if model.name in names})


def _without_empty(phrases: Mapping[str, PhraseByCase]) -> Mapping[str, PhraseByCase]:
    return {name: phrase for name, phrase in phrases.items() if phrase}
