"""Where library, templates and targets are found."""

from dataclasses import dataclass
from pathlib import Path

from mutator.fault_models import FaultModels
from mutator.manifest import TargetManifest
from mutator.spec import FaultSpec
from mutator.stpa import ContextTable, HazardList


@dataclass(frozen=True)
class Workspace:
    """A fault library, a templates folder, and optionally a target root that overrides the manifest's."""

    library: Path
    templates: Path
    target: Path | None = None

    @classmethod
    def find(
        cls,
        root: Path | None = None,
        library: Path | None = None,
        templates: Path | None = None,
        target: Path | None = None,
    ) -> "Workspace":
        """Options first, then MUTATOR_LIBRARY, MUTATOR_TEMPLATES, MUTATOR_TARGET, then `root`, MUTATOR_ROOT,
        or the nearest folder from the current one upward that holds fault_library/; else a MutatorError."""
        raise NotImplementedError

    def manifest(self, name: str = "openpilot") -> TargetManifest:
        """The target `name`, or the manifest file of that path."""
        raise NotImplementedError

    def target_names(self) -> tuple[str, ...]:
        raise NotImplementedError

    def fault_models(self) -> FaultModels:
        raise NotImplementedError

    def spec_files(self) -> tuple[Path, ...]:
        """Every fault spec of the library, sorted."""
        raise NotImplementedError

    def spec(self, name: str | Path) -> FaultSpec:
        """The spec `<module>/<fault_type>`, or the spec file of that path."""
        raise NotImplementedError

    def specs(self) -> tuple[FaultSpec, ...]:
        """All specs of the library, in the order of `spec_files`."""
        raise NotImplementedError

    def scenario_names(self) -> tuple[str, ...]:
        raise NotImplementedError

    def scenario(self, name: str) -> Path:
        """File of the scenario `name`, or the scenario file of that path."""
        raise NotImplementedError

    def campaign(self, name: str | Path) -> Path:
        """File of the campaign `name`, or the campaign file of that path."""
        raise NotImplementedError

    def campaign_names(self) -> tuple[str, ...]:
        raise NotImplementedError

    def context_table(self, name: str) -> ContextTable:
        """The context table `name` of fault_library/stpa."""
        raise NotImplementedError

    def hazards(self) -> HazardList:
        """Accidents and hazards of fault_library/stpa/hazards.yaml."""
        raise NotImplementedError
