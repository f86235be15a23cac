"""The inputs of a run besides its plan."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from mutator._common.bounded_reading import read_bounded
from mutator._common.hashing import digest
from mutator._common.pickled_values import PickledValue
from mutator.faults.fault_models import FaultModels
from mutator.model import Experiment
from mutator.store.planned_scenarios import PlannedScenarios, planned_scenarios_of
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest

if TYPE_CHECKING:
    from mutator.campaigns.plan_tally import PlanTally
    from mutator.workspace import Workspace


@dataclass(frozen=True, slots=True, kw_only=True)
class RunInputs(PickledValue):
    """A target, the fault models, the file of each scenario of the library by name, the file of each family
    by name, and the concrete scenarios that these gave.

    The command that reads the library's YAML passes them to its workers, which need no reader of YAML.
    """

    manifest: TargetManifest
    fault_models: FaultModels
    scenario_files: Mapping[str, Path]
    family_files: Mapping[str, Path] = field(default_factory=dict)
    planned_scenarios: PlannedScenarios | None = None

    @classmethod
    def from_workspace(
        cls, workspace: "Workspace", manifest: TargetManifest, scenarios: Iterable[str]
    ) -> "RunInputs":
        """Return the inputs in a workspace; MutatorError for a missing scenario or a mistake in a model."""
        files = {name: workspace.scenario(name) for name in sorted(scenarios)}
        return cls(manifest=manifest, fault_models=workspace.fault_models(), scenario_files=files)

    @classmethod
    def of_experiments(
        cls, workspace: "Workspace", manifest: TargetManifest, experiments: Iterable[Experiment]
    ) -> "RunInputs":
        """Return the inputs of experiments that are in no plan; MutatorError as in `from_workspace`."""
        concrete_by_name = {experiment.scenario: experiment.concrete for experiment in experiments}
        scenarios = [name for name, concrete in concrete_by_name.items() if concrete is None]
        families = {concrete.family for concrete in concrete_by_name.values() if concrete is not None}
        return cls.from_workspace(workspace, manifest, scenarios)._with_families(workspace, families)

    @classmethod
    def of_plan(cls, workspace: "Workspace", manifest: TargetManifest, tally: "PlanTally") -> "RunInputs":
        """Return the inputs of a plan that is in no run folder; MutatorError as in `from_workspace`."""
        inputs = cls.from_workspace(workspace, manifest, {run.scenario for run in tally.listed_goldens})
        return inputs._with_families(workspace, tally.families)

    @classmethod
    def of_run(cls, workspace: "Workspace", folder: RunFolder) -> "RunInputs":
        """Return the inputs of a run folder in a workspace; MutatorError as in `from_workspace`."""
        planned = planned_scenarios_of(folder.path)
        inputs = cls.from_workspace(
            workspace, workspace.manifest_of(folder.head), {run.scenario for run in folder.listed_goldens}
        )
        return inputs._with_families(workspace, planned.families, planned) if planned else inputs

    def _with_families(
        self, workspace: "Workspace", names: Iterable[str], planned: PlannedScenarios | None = None
    ) -> "RunInputs":
        files = {name: workspace.family(name).path for name in sorted(names)}
        return replace(self, family_files=files, planned_scenarios=planned)

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
            **{f"defence {name}": sha256 for name, sha256 in self.manifest.defences.items()},
            **{f"scenario {name}": digest(read_bounded(path)) for name, path in self.scenario_files.items()},
            **{f"family {name}": digest(read_bounded(path)) for name, path in self.family_files.items()},
        }
