"""Turns a campaign into experiments: selects and expands faults, creates triggers, draws random times."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from fnmatch import fnmatchcase
from itertools import chain
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import is_inside, path_below
from mutator._common.hashing import digest
from mutator._common.message_text import describe_choices
from mutator.campaigns.campaign_files import Campaign
from mutator.campaigns.campaign_triggers import listed_triggers
from mutator.campaigns.operator_faults import OperatorFault, OperatorFaults
from mutator.campaigns.operator_selection import When
from mutator.campaigns.sampling import spread
from mutator.config.yaml_sources import KeyPath
from mutator.errors import MutatorError
from mutator.faults.fault_specs import FaultSpec
from mutator.faults.spec_expansion import expand
from mutator.model import Experiment, Fault, Method, Trigger
from mutator.operators.executed_lines import GoldenRunInputs
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import always_trigger, draw_time, trigger_at_time
from mutator.workspace import Workspace

_Numbered = tuple[int, Fault]  # a fault and its position among its variant's values


class Expansion:
    """Everything from which a campaign's experiments are created, for one seed and one reading."""

    def __init__(
        self, workspace: Workspace, campaign: Campaign, manifest: TargetManifest, seed: int, reading: str
    ) -> None:
        self.workspace = workspace
        self.campaign = campaign
        self.manifest = manifest
        self.seed = seed
        self.reading = reading
        armed_after_s = campaign.armed_after(reading)
        self.armed_after_s = manifest.armed_after_s if armed_after_s is None else armed_after_s
        self._digests: dict[str, str] = {}
        self._specs: list[tuple[FaultSpec, ...]] = []
        self._models = workspace.fault_models()
        self._operators = OperatorFaults(manifest, self._models, campaign.limits)

    def with_seed(self, seed: int) -> "Expansion":
        """Return the same expansion with another seed, without reading files again."""
        other = copy(self)
        other.seed = seed
        return other

    @property
    def told(self) -> tuple[str, ...]:
        return tuple(self._operators.told)

    def experiments(self) -> tuple[Experiment, ...]:
        """Return all experiments. Those that share a golden run are adjacent."""
        self._check_setting()
        faults = self._selected()
        mutants = self._mutants()
        triggers = self._triggers()
        made = [
            (order, experiment)
            for order, scenario in enumerate(self.campaign.scenarios)
            for experiment in (
                *self._of_scenario(scenario, faults, triggers),
                *self._of_operators(scenario, mutants, triggers),
            )
        ]
        made.sort(key=lambda item: (item[0], item[1].changes))
        return tuple(experiment for _, experiment in made)

    def canary(self) -> Experiment:
        canary = self.campaign.canary
        if canary.hazard not in self.manifest.hazards:
            raise self.campaign.error(
                ("canary", "hazard"),
                f"hazard '{canary.hazard}'",
                expected=f"one of {', '.join(self.manifest.hazards)}",
                remedy="name a hazard of the target's manifest",
            )
        known = (*self._library(), *chain.from_iterable(self._files().values()))
        faults = [fault for _, fault in known if fault.spec == canary.spec]
        if not faults:
            raise self._unmatched(("canary", "spec"), canary.spec)
        worst = max(faults, key=lambda fault: fault.size)
        trigger = trigger_at_time(canary.at_s, name="canary")
        return self._experiment(worst, canary.scenario, Method.RANDOM, trigger)

    def _check_setting(self) -> None:
        keys = self.campaign.setting_keys(self.reading)
        for i, change in enumerate(self.campaign.setting_in(self.reading)):
            if change not in self.manifest.changes:
                raise self.campaign.error(
                    (*keys, i),
                    f"change '{change}'",
                    expected=describe_choices(self.manifest.changes),
                    remedy="name a change of the target's manifest",
                )

    def _library(self) -> list[_Numbered]:
        if not self._specs:
            self._specs.append(self.workspace.specs())
        return self._expanded(self._specs[0])

    def _files(self) -> dict[int, list[_Numbered]]:
        files = {i: one.file for i, one in enumerate(self.campaign.faults) if one.file is not None}
        return {i: self._expanded([self._spec_of_file(("faults", i, "spec"), files[i])]) for i in files}

    def _spec_of_file(self, keys: KeyPath, file: Path) -> FaultSpec:
        if not file.is_file():
            raise self.campaign.error(
                keys,
                f"no file {file}",
                expected="the path of a spec file, relative to the campaign's folder",
                remedy="correct the path",
            )
        places = (self.campaign.path.parent, self.workspace.library)
        if not any(is_inside(place, file) for place in places):
            raise self.campaign.error(
                keys,
                f"'{file}' is neither below the campaign's folder nor in the library",
                expected="a file in one of them, because a campaign can come from somebody else",
                remedy="copy it there",
            )
        spec = self.workspace.spec(file)
        known = path_below(self.workspace.library / "faults", f"{spec.name}.yaml")
        if known.exists() and not known.samefile(file):
            raise self.campaign.error(
                keys,
                f"{file.name} has the name of a spec in the library, {spec.name}",
                expected="a unique name",
                remedy="change `fault_type` in the file",
            )
        return spec

    def _expanded(self, specs: Iterable[FaultSpec]) -> list[_Numbered]:
        numbered: list[_Numbered] = []
        for spec in specs:
            seen: dict[str, int] = {}
            for fault in expand(spec, self.seed, self.reading, models=self._models, manifest=self.manifest):
                number = seen.get(fault.spec, 0)
                seen[fault.spec] = number + 1
                numbered.append((number, fault))
        return numbered

    def _selected(self) -> list[_Numbered]:
        library, files = self._library(), self._files()
        selected: dict[str, _Numbered] = {}
        for i, selection in enumerate(self.campaign.faults):
            if selection.operators is not None:
                continue
            variants: dict[str, list[_Numbered]] = {}
            for numbered in files.get(i, library):
                if i in files or fnmatchcase(numbered[1].spec, selection.spec):
                    variants.setdefault(numbered[1].spec, []).append(numbered)
            if not variants:
                raise self._unmatched(("faults", i, "spec"), selection.spec, library)
            for faults in variants.values():
                wanted = spread(len(faults), selection.values or len(faults))
                selected |= {faults[k][1].id: faults[k] for k in wanted if faults[k][1].id not in selected}
        return list(selected.values())

    def _mutants(self) -> list[OperatorFault]:
        """Return the mutants of operators, without duplicates.

        A mutant in several selections is active whenever one of them requires it.
        """
        found: dict[str, OperatorFault] = {}
        for i, selection in enumerate(self.campaign.faults):
            if selection.operators is not None:
                with self._placed(("faults", i, "in")):
                    mutants = self._operators.of(selection.operators, self._drives(), self.seed, self.reading)
                for one in mutants:
                    known = found.get(one.fault.id, one)
                    found[one.fault.id] = replace(one, when=tuple(dict.fromkeys((*known.when, *one.when))))
        return list(found.values())

    def _drives(self) -> dict[str, GoldenRunInputs]:
        return {
            name: GoldenRunInputs(
                scenario=self._scenario_file(name),
                changes=self.campaign.setting_in(self.reading),
                seed=self.seed,
            )
            for name in self.campaign.scenarios
        }

    def _unmatched(self, keys: KeyPath, pattern: str, library: Sequence[_Numbered] = ()) -> MutatorError:
        whole = f"{pattern}/*"
        fits = any(fnmatchcase(fault.spec, whole) for _, fault in library)
        return self.campaign.error(
            keys,
            f"no fault in the library matches '{pattern}'",
            expected="<module>/<fault_type>/<variant>, with * for any text",
            remedy=f"write '{whole}' for all its variants" if fits else "see `mutator list`",
        )

    def _triggers(self) -> tuple[Trigger, ...]:
        """Return the triggers of the context table or list. Each random time is paired with one of them."""
        if self.campaign.table is None:
            return listed_triggers(
                self.campaign.listed,
                self.campaign.yaml,
                self.manifest,
                armed_after_s=self.armed_after_s,
                hold_s=self.campaign.hold_s,
            )
        with self._placed(("triggers", "table")):
            variables = self.manifest.observation.variables
            table = self.workspace.context_table(self.campaign.table, variables)
        with self._placed(("triggers", "rows")):
            return table.triggers(
                hold_s=self.campaign.hold_s, armed_after_s=self.armed_after_s, rows=self.campaign.rows
            )

    def _of_scenario(
        self, scenario: str, faults: list[_Numbered], triggers: tuple[Trigger, ...]
    ) -> Iterator[Experiment]:
        for number, fault in faults:
            for method in self.campaign.methods:
                for row in triggers:
                    trigger = self._trigger(method, scenario, fault, number, row)
                    yield self._experiment(fault, scenario, method, trigger)

    def _of_operators(
        self, scenario: str, mutants: list[OperatorFault], triggers: tuple[Trigger, ...]
    ) -> Iterator[Experiment]:
        """Yield the experiments of each mutant in the scenarios that execute its changed line.

        Permanent mutants are always active; transient ones follow the campaign's triggers.
        """
        permanent = always_trigger(armed_after_s=self.armed_after_s)
        for one in mutants:
            if scenario not in one.scenarios:
                continue
            if When.PERMANENT in one.when:
                yield self._experiment(one.fault, scenario, Method.GUIDED, permanent)
            if When.TRANSIENT in one.when:
                number = int(one.fault.id, 16)
                for made in self._of_scenario(scenario, [(number, one.fault)], triggers):
                    if made.trigger.condition != permanent.condition:
                        yield made

    def _trigger(self, method: Method, scenario: str, fault: Fault, number: int, row: Trigger) -> Trigger:
        if method is Method.RANDOM:
            return self._random(scenario, fault, number, row)
        return row

    def _random(self, scenario: str, fault: Fault, number: int, row: Trigger) -> Trigger:
        """Return the random partner of a row's trigger.

        The drawn time depends on the reading only through the earliest possible time.
        """
        assert self.campaign.random_until_s is not None  # the schema requires it for random times
        time = draw_time(
            self.seed,
            f"{scenario}/{fault.spec}/{number}/{row.name}",
            first_s=self.armed_after_s,
            last_s=self.campaign.random_until_s,
            step_s=self.manifest.step_s,
        )
        return trigger_at_time(time, name=f"random/{row.name}", hold_s=self.campaign.hold_s)

    def _experiment(self, fault: Fault, scenario: str, method: Method, trigger: Trigger) -> Experiment:
        return Experiment(
            fault=fault,
            scenario=scenario,
            scenario_digest=self._scenario_digest(scenario),
            method=method,
            trigger=trigger,
            seed=self.seed,
            setting=self.campaign.setting_in(self.reading),
            after_hazard=self.campaign.after_hazard,
        )

    def _scenario_digest(self, scenario: str) -> str:
        if scenario not in self._digests:
            self._digests[scenario] = digest(read_bounded(self._scenario_file(scenario)))
        return self._digests[scenario]

    def _scenario_file(self, scenario: str) -> Path:
        known = self.workspace.scenarios
        if scenario not in known:  # a file outside the library could change, or differ on another machine
            raise self.campaign.error(
                self._scenario_keys(scenario),
                f"no scenario '{scenario}' in the library",
                expected=describe_choices(known),
                remedy="correct the name, or add the file to the library's scenarios/",
            )
        return self.workspace.scenario(scenario)

    @contextmanager
    def _placed(self, keys: KeyPath) -> Iterator[None]:
        """Point errors without a line number to `keys` in the campaign file; leave others unchanged."""
        try:
            yield
        except MutatorError as err:
            if err.line is not None:
                raise
            raise self.campaign.error(
                keys, err.got, expected=err.expected or "", remedy=err.remedy or "correct the name"
            ) from None

    def _scenario_keys(self, scenario: str) -> KeyPath:
        if scenario in self.campaign.scenarios:
            return ("scenarios", self.campaign.scenarios.index(scenario))
        return ("canary", "scenario")
