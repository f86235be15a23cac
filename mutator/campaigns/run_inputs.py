"""The inputs of a run besides its plan."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from mutator._common.bounded_reading import read_bounded
from mutator._common.hashing import digest
from mutator._common.pickled_values import PickledValue
from mutator.faults.fault_models import FaultModels
from mutator.targets.manifest import TargetManifest

if TYPE_CHECKING:
    from mutator.workspace import Workspace


@dataclass(frozen=True, slots=True, kw_only=True)
class RunInputs(PickledValue):
    """A target, the fault models, and the file of each scenario by name.

    The command that reads the library's YAML passes them to its workers, which need no reader of YAML.
    """

    manifest: TargetManifest
    fault_models: FaultModels
    scenario_files: Mapping[str, Path]

    @classmethod
    def from_workspace(
        cls, workspace: "Workspace", manifest: TargetManifest, scenarios: Iterable[str]
    ) -> "RunInputs":
        """Return the inputs in a workspace; MutatorError for a missing scenario or a mistake in a model."""
        files = {name: workspace.scenario(name) for name in sorted(scenarios)}
        return cls(manifest=manifest, fault_models=workspace.fault_models(), scenario_files=files)

    def to_bytes(self) -> bytes:
        """Return the inputs for another process, which reads the target's tree itself."""
        # the copied manifest has no cached properties, such as the bytes of the tree
        return PickledValue.to_bytes(replace(self, manifest=replace(self.manifest)))

    def digest_by_source(self) -> dict[str, str]:
        """Return the digests, by name, of all files outside the plan that affect results."""
        return {
            "target": self.manifest.tree.digest,
            "manifest": digest(read_bounded(self.manifest.path)),
            "templates": self.fault_models.digest,
            **{f"scenario {name}": digest(read_bounded(path)) for name, path in self.scenario_files.items()},
        }
