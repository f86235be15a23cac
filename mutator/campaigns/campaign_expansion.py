"""Turns a campaign into experiments: selects and expands faults, creates triggers, draws random times."""

from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from dataclasses import replace
from fnmatch import fnmatchcase
from itertools import chain
from pathlib import Path

from mutator._common.confined_files import is_inside, path_below
from mutator._common.message_text import describe_choices
from mutator.campaigns.campaign_files import Campaign
from mutator.campaigns.campaign_scenarios import CampaignScenarios
from mutator.campaigns.campaign_triggers import build_listed_triggers
from mutator.campaigns.fault_free_drives import FaultFreeDrive
from mutator.campaigns.operator_faults import OperatorFault, OperatorFaultFinder
from mutator.campaigns.operator_selection import MutantActivity
from mutator.campaigns.sampling import evenly_spread_indices
from mutator.config.yaml_source_lines import KeyPath
from mutator.errors import MutatorError
from mutator.faults.fault_specs import FaultSpec
from mutator.faults.spec_expansion import expand_spec
from mutator.model import Experiment, Fault, Method, Trigger
from mutator.operators.executed_lines_and_types import GoldenRunInputs
from mutator.store.golden_runs import GoldenRun
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import always_trigger, draw_trigger_time, trigger_at_time
from mutator.workspace import Workspace

_NumberedFault = tuple[int, Fault]  # a fault and its position among its variant's values


class CampaignExpansion:
    """Everything from which a campaign's experiments are created, for one seed and one reading."""

    def __init__(
        self, workspace: Workspace, campaign: Campaign, manifest: TargetManifest, seed: int, reading: str
    ) -> None:
        self.workspace = workspace
        self.campaign = campaign
        self.manifest = manifest
        self.seed = seed
        self.reading = reading
        armed_after_s = campaign.armed_after_s_in(reading)
        self.armed_after_s = manifest.armed_after_s if armed_after_s is None else armed_after_s
        self.scenarios = CampaignScenarios(workspace, campaign, manifest, seed)
        self._library_specs: list[tuple[FaultSpec, ...]] = []
        self._fault_models = workspace.fault_models()
        self._operator_faults = OperatorFaultFinder(manifest, self._fault_models, campaign.golden_run_limits)

    def with_seed(self, seed: int) -> "CampaignExpansion":
        """Return the same expansion with another seed, without reading files again."""
        other = copy(self)
        other.seed = seed
        return other

    @property
    def operator_notes(self) -> tuple[str, ...]:
        return tuple(self._operator_faults.notes)

    def build_experiments(self) -> tuple[Experiment, ...]:
        """Return all experiments. Those that share a golden run are adjacent."""
        self._check_change_names()
        faults = self._selected_faults()
        operator_faults = self._selected_operator_faults()
        triggers = self._campaign_triggers()
        ordered = [
            (order, experiment)
            for order, scenario in enumerate(self.scenarios.names)
            for experiment in (
                *self._experiments_of_faults(scenario, faults, triggers),
                *self._experiments_of_operator_faults(scenario, operator_faults, triggers),
            )
        ]
        # changes within a scenario have golden runs of their own, which the experiments of a chunk share
        ordered.sort(key=lambda item: (item[0], item[1].changes))
        return tuple(experiment for _, experiment in ordered)

    def fault_free_drives(self, *, several_seeds: bool) -> Iterator[FaultFreeDrive]:
        """Yield the golden run of each scenario."""
        self._check_change_names()
        for name in self.scenarios.names:
            scenario_digest, concrete = self.scenarios.digest_and_concrete(name)
            seed = self.seed if several_seeds else None
            golden_run = GoldenRun(name, self.campaign.changes_in(self.reading), seed)
            yield FaultFreeDrive(golden_run=golden_run, scenario_digest=scenario_digest, concrete=concrete)

    def build_canary(self) -> Experiment | None:
        canary = self.campaign.canary
        if canary is None:
            return None
        if canary.hazard not in self.manifest.hazard_names:
            raise self.campaign.error(
                ("canary", "hazard"),
                f"hazard '{canary.hazard}'",
                expected=f"one of {', '.join(self.manifest.hazard_names)}",
                remedy="name a hazard of the target's manifest",
            )
        candidates = (*self._library_faults(), *chain.from_iterable(self._faults_of_spec_files().values()))
        faults = [fault for _, fault in candidates if fault.spec == canary.spec]
        if not faults:
            raise self._unmatched_pattern_error(("canary", "spec"), canary.spec)
        largest = max(faults, key=lambda fault: fault.size)  # the most likely one to cause the hazard
        trigger = trigger_at_time(canary.at_s, name="canary")
        return self._build_experiment(largest, canary.scenario, Method.RANDOM, trigger)

    def _check_change_names(self) -> None:
        keys = self.campaign.keys_of_changes(self.reading)
        for i, change in enumerate(self.campaign.changes_in(self.reading)):
            if change not in self.manifest.args_by_change:
                raise self.campaign.error(
                    (*keys, i),
                    f"change '{change}'",
                    expected=describe_choices(self.manifest.args_by_change),
                    remedy="name a change of the target's manifest",
                )

    def _library_faults(self) -> list[_NumberedFault]:
        if not self._library_specs:
            self._library_specs.append(self.workspace.specs())
        return self._expand_specs(self._library_specs[0])

    def _faults_of_spec_files(self) -> dict[int, list[_NumberedFault]]:
        files = {
            i: selection.spec_file
            for i, selection in enumerate(self.campaign.fault_selections)
            if selection.spec_file is not None
        }
        return {i: self._expand_specs([self._load_spec_file(("faults", i, "spec"), files[i])]) for i in files}

    def _load_spec_file(self, keys: KeyPath, file: Path) -> FaultSpec:
        if not file.is_file():
            raise self.campaign.error(
                keys,
                f"no file {file}",
                expected="the path of a spec file, relative to the campaign's folder",
                remedy="correct the path",
            )
        allowed_folders = (self.campaign.path.parent, self.workspace.library)
        if not any(is_inside(place, file) for place in allowed_folders):
            raise self.campaign.error(
                keys,
                f"'{file}' is neither below the campaign's folder nor in the library",
                expected="a file in one of them, because a campaign can come from somebody else",
                remedy="copy it there",
            )
        spec = self.workspace.spec(file)
        library_file = path_below(self.workspace.library / "faults", f"{spec.name}.yaml")
        if library_file.exists() and not library_file.samefile(file):
            raise self.campaign.error(
                keys,
                f"{file.name} has the name of a spec in the library, {spec.name}",
                expected="a unique name",
                remedy="change `fault_type` in the file",
            )
        return spec

    def _expand_specs(self, specs: Iterable[FaultSpec]) -> list[_NumberedFault]:
        numbered: list[_NumberedFault] = []
        for spec in specs:
            count_by_variant: dict[str, int] = {}
            for fault in expand_spec(
                spec, self.seed, self.reading, models=self._fault_models, manifest=self.manifest
            ):
                number = count_by_variant.get(fault.spec, 0)
                count_by_variant[fault.spec] = number + 1
                numbered.append((number, fault))
        return numbered

    def _selected_faults(self) -> list[_NumberedFault]:
        library, files = self._library_faults(), self._faults_of_spec_files()
        selected: dict[str, _NumberedFault] = {}
        for i, selection in enumerate(self.campaign.fault_selections):
            if selection.operator_selection is not None:
                continue
            variants: dict[str, list[_NumberedFault]] = {}
            for numbered in files.get(i, library):
                if i in files or fnmatchcase(numbered[1].spec, selection.spec_pattern):
                    variants.setdefault(numbered[1].spec, []).append(numbered)
            if not variants:
                raise self._unmatched_pattern_error(("faults", i, "spec"), selection.spec_pattern, library)
            for faults in variants.values():
                indices = evenly_spread_indices(len(faults), selection.values_per_variant or len(faults))
                selected |= {faults[k][1].id: faults[k] for k in indices if faults[k][1].id not in selected}
        return list(selected.values())

    def _selected_operator_faults(self) -> list[OperatorFault]:
        """Return the mutants of operators, without duplicates.

        A mutant in several selections is active whenever one of them requires it.
        """
        operator_fault_by_id: dict[str, OperatorFault] = {}
        for i, selection in enumerate(self.campaign.fault_selections):
            if selection.operator_selection is not None:
                with self.campaign.locating_errors(("faults", i, "in")):
                    operator_faults = self._operator_faults.faults_of_selection(
                        selection.operator_selection,
                        self._golden_inputs_by_scenario(),
                        self.seed,
                        self.reading,
                    )
                for operator_fault in operator_faults:
                    earlier = operator_fault_by_id.get(operator_fault.fault.id, operator_fault)
                    operator_fault_by_id[operator_fault.fault.id] = replace(
                        operator_fault,
                        activities=tuple(dict.fromkeys((*earlier.activities, *operator_fault.activities))),
                    )
        return list(operator_fault_by_id.values())

    def _golden_inputs_by_scenario(self) -> dict[str, GoldenRunInputs]:
        return {
            name: GoldenRunInputs(
                scenario=self.scenarios.file(name),
                changes=self.campaign.changes_in(self.reading),
                seed=self.seed,
            )
            for name in self.scenarios.names
        }

    def _unmatched_pattern_error(
        self, keys: KeyPath, pattern: str, library: Sequence[_NumberedFault] = ()
    ) -> MutatorError:
        with_variants = f"{pattern}/*"
        is_prefix = any(fnmatchcase(fault.spec, with_variants) for _, fault in library)
        return self.campaign.error(
            keys,
            f"no fault in the library matches '{pattern}'",
            expected="<module>/<fault_type>/<variant>, with * for any text",
            remedy=f"write '{with_variants}' for all its variants" if is_prefix else "see `mutator list`",
        )

    def _campaign_triggers(self) -> tuple[Trigger, ...]:
        """Return the triggers of the context table or list. Each random time is paired with one of them."""
        if self.campaign.context_table is None:
            return build_listed_triggers(
                self.campaign.listed_triggers,
                self.campaign.yaml_source,
                self.manifest,
                armed_after_s=self.armed_after_s,
                hold_s=self.campaign.hold_s,
            )
        with self.campaign.locating_errors(("triggers", "table")):
            variables = self.manifest.observation.variables
            table = self.workspace.context_table(self.campaign.context_table, variables)
        with self.campaign.locating_errors(("triggers", "rows")):
            return table.triggers(
                hold_s=self.campaign.hold_s, armed_after_s=self.armed_after_s, rows=self.campaign.context_ids
            )

    def _experiments_of_faults(
        self, scenario: str, faults: list[_NumberedFault], triggers: tuple[Trigger, ...]
    ) -> Iterator[Experiment]:
        for number, fault in faults:
            for method in self.campaign.methods:
                for paired_trigger in triggers:
                    trigger = self._trigger_of_method(method, scenario, fault, number, paired_trigger)
                    yield self._build_experiment(fault, scenario, method, trigger)

    def _experiments_of_operator_faults(
        self, scenario: str, operator_faults: list[OperatorFault], triggers: tuple[Trigger, ...]
    ) -> Iterator[Experiment]:
        """Yield the experiments of each mutant in the scenarios that execute its changed line.

        Permanent mutants are always active; transient ones follow the campaign's triggers.
        """
        permanent = always_trigger(armed_after_s=self.armed_after_s)
        for operator_fault in operator_faults:
            if scenario not in operator_fault.executing_scenarios:
                continue
            if MutantActivity.PERMANENT in operator_fault.activities:
                yield self._build_experiment(operator_fault.fault, scenario, Method.GUIDED, permanent)
            if MutantActivity.TRANSIENT in operator_fault.activities:
                # a mutant has no values to count, so its id distinguishes its random times
                number = int(operator_fault.fault.id, 16)
                for experiment in self._experiments_of_faults(
                    scenario, [(number, operator_fault.fault)], triggers
                ):
                    # `always` in the campaign's list would repeat the permanent experiment
                    if experiment.trigger.condition != permanent.condition:
                        yield experiment

    def _trigger_of_method(
        self, method: Method, scenario: str, fault: Fault, number: int, paired_trigger: Trigger
    ) -> Trigger:
        if method is Method.RANDOM:
            return self._random_trigger(scenario, fault, number, paired_trigger)
        return paired_trigger

    def _random_trigger(self, scenario: str, fault: Fault, number: int, paired_trigger: Trigger) -> Trigger:
        """Return the random partner of a row's trigger.

        The drawn time depends on the reading only through the earliest possible time.
        """
        assert self.campaign.random_until_s is not None  # the schema requires it for random times
        time = draw_trigger_time(
            self.seed,
            # what else the campaign selects does not affect this experiment's draw
            f"{scenario}/{fault.spec}/{number}/{paired_trigger.name}",
            first_s=self.armed_after_s,
            last_s=self.campaign.random_until_s,
            step_s=self.manifest.step_s,
        )
        return trigger_at_time(time, name=f"random/{paired_trigger.name}", hold_s=self.campaign.hold_s)

    def _build_experiment(self, fault: Fault, scenario: str, method: Method, trigger: Trigger) -> Experiment:
        scenario_digest, concrete = self.scenarios.digest_and_concrete(scenario)
        return Experiment(
            fault=fault,
            scenario=scenario,
            scenario_digest=scenario_digest,
            method=method,
            trigger=trigger,
            seed=self.seed,
            setting=self.campaign.changes_in(self.reading),
            after_hazard=self.campaign.after_hazard,
            concrete=concrete,
        )
