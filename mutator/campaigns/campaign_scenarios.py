"""The scenarios of a campaign: those that it names, and those that it draws from families."""

from collections import Counter
from functools import cached_property
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import checked_name_not_path, path_below
from mutator._common.files import ScratchFolder
from mutator._common.hashing import digest
from mutator._common.message_text import describe_choices
from mutator.campaigns.campaign_files import Campaign
from mutator.config.yaml_source_lines import KeyPath
from mutator.families.family import Family
from mutator.families.family_facts import FamilyFacts
from mutator.families.scenario_sampling import sample_scenarios
from mutator.model import ConcreteScenario
from mutator.results.table_columns import check_parameter_names
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace


class CampaignScenarios:
    """The scenarios of a campaign for all its seeds; families are drawn with `seed`, the first.

    MutatorError, at the campaign's line, for an unknown scenario or family.
    """

    def __init__(self, workspace: Workspace, campaign: Campaign, manifest: TargetManifest, seed: int) -> None:
        self._workspace, self._campaign, self._manifest, self._seed = workspace, campaign, manifest, seed
        self._digest_and_concrete_by_name: dict[str, tuple[str, ConcreteScenario | None]] = {}
        self._temporary_folders: list[ScratchFolder] = []  # of concrete scenarios, if operators drive them

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of all scenarios, in the order of the campaign."""
        names: list[str] = []
        for i, selection in enumerate(self._campaign.scenario_selections):
            if isinstance(selection, str):
                names.append(selection)
                continue
            family = self._family_by_place[i]
            with self._campaign.locating_errors(("scenarios", i, "family")):
                drawn = sample_scenarios(
                    family, selection.count, selection.sampling or family.sampling, self._seed
                )
            self._digest_and_concrete_by_name |= {s.name: (s.digest, s) for s in drawn}
            names += [scenario.name for scenario in drawn]
        if twice := [name for name, count in Counter(names).items() if count > 1]:
            raise self._campaign.error(
                ("scenarios",),
                f"scenario {twice[0]} from the library and from a family",
                expected="names that differ",
                remedy="rename the scenario of the library",
            )
        return tuple(names)

    @property
    def families(self) -> tuple[FamilyFacts, ...]:
        """The families from which the campaign draws scenarios, in the order of the file."""
        return tuple(family.facts for family in self._family_by_place.values())

    def digest_and_concrete(self, name: str) -> tuple[str, ConcreteScenario | None]:
        """Return the digest of a scenario and, if a family gave it, the scenario."""
        if name not in self._digest_and_concrete_by_name:
            scenario_digest = digest(read_bounded(self._library_file(name)))
            self._digest_and_concrete_by_name[name] = scenario_digest, None
        return self._digest_and_concrete_by_name[name]

    def file(self, name: str) -> Path:
        """Return the file of a scenario; that of a family is in a temporary folder."""
        _, concrete = self.digest_and_concrete(name)
        if concrete is None:
            return self._library_file(name)
        if not self._temporary_folders:
            self._temporary_folders.append(ScratchFolder("mutator-scenarios-"))
        path = path_below(self._temporary_folders[0].path, f"{name}.yaml")
        path.write_text(concrete.text)
        return path

    @cached_property
    def _family_by_place(self) -> dict[int, Family]:
        """The families by their places in the campaign's list of scenarios."""
        families: dict[int, Family] = {}
        for i, selection in enumerate(self._campaign.scenario_selections):
            if isinstance(selection, str):
                continue
            with self._campaign.locating_errors(("scenarios", i, "family")):
                name = checked_name_not_path(selection.family, self._campaign.path)
                families[i] = self._workspace.family(name)
                check_parameter_names(self._manifest, families[i].facts)
        return families

    def _library_file(self, name: str) -> Path:
        scenarios = self._workspace.scenarios
        if name not in scenarios:  # a file outside the library could change, or differ on another machine
            raise self._campaign.error(
                self._keys_of(name),
                f"no scenario '{name}' in the library",
                expected=describe_choices(scenarios),
                remedy="correct the name, or add the file to the library's scenarios/",
            )
        return self._workspace.scenario(name)

    def _keys_of(self, name: str) -> KeyPath:
        if name in self._campaign.scenarios:
            return ("scenarios", self._campaign.scenario_selections.index(name))
        return ("canary", "scenario")
