"""The faults of a spec of the toy."""

from mutator.faults.spec_expansion import expand_spec
from mutator.model import Fault
from mutator.workspace import Workspace

SPEC_NAME = "sensor/distance"


def faults(workspace: Workspace, seed: int = 3, reading: str | None = None) -> tuple[Fault, ...]:
    return expand_spec(
        workspace.spec(SPEC_NAME),
        seed,
        reading,
        models=workspace.fault_models(),
        manifest=workspace.manifest("toy"),
    )
