"""Where the faults of a campaign are described: the file and line to which an editor goes."""

from functools import cached_property

from mutator.campaigns.campaign_files import Campaign
from mutator.execution.listed_items import SourcePlace
from mutator.faults.fault_specs import FaultSpec
from mutator.model import Fault
from mutator.workspace import Workspace


class SpecPlaces:
    """The places of a campaign's specs. A mutant of an operator is described by the campaign itself."""

    def __init__(self, workspace: Workspace, campaign: Campaign) -> None:
        self._workspace, self._campaign = workspace, campaign
        self._place_by_variant: dict[str, SourcePlace] = {}

    @property
    def has_operators(self) -> bool:
        return any(selection.operator_selection for selection in self._campaign.fault_selections)

    def place_of(self, fault: Fault) -> SourcePlace:
        """Return the file and line of a fault's variant."""
        return self.place_of_variant(fault.spec)

    def place_of_variant(self, name: str) -> SourcePlace:
        """Return the file and line of a variant with this full name."""
        if name not in self._place_by_variant:
            self._place_by_variant[name] = self._find_place(name)
        return self._place_by_variant[name]

    def _find_place(self, variant: str) -> SourcePlace:
        name, _, variant_name = variant.rpartition("/")
        spec = self._spec_by_name.get(name)
        if spec is None:
            return str(self._campaign.path), self._campaign.yaml_source.line_of(("faults",))
        return str(spec.path), spec.source.line_of(("variants", variant_name))

    @cached_property
    def _spec_by_name(self) -> dict[str, FaultSpec]:
        files = [s.spec_file for s in self._campaign.fault_selections if s.spec_file is not None]
        return {spec.name: spec for spec in (*self._workspace.specs(), *map(self._workspace.spec, files))}
