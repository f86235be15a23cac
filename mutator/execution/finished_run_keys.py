"""What decides the record of a run, as a key: two runs with the same key have the same result.

The key has neither the experiment's id, which contains how its trigger was chosen, nor limits, which only cut
runs off. It has the scenario's name beside its digest: an error of the target can contain it.
"""

import platform
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from mutator._common.bounded_reading import read_bounded
from mutator._common.extension_doors import TRACE_IMPORTER_DOOR
from mutator._common.hashing import as_json_types, digest
from mutator.campaigns import run_environment
from mutator.model import Experiment
from mutator.targets.manifest import TargetManifest

if TYPE_CHECKING:
    from mutator.workspace import Workspace

_SCHEMA = "finished/1"
_HARNESS_FOLDER = Path(__file__).parents[1]
# packages that only show results
_PACKAGES_WITHOUT_EFFECT = frozenset(
    ("cli", "exports", "figures", "paper", "reference", "report", "review", "serve", "web")
)


def surroundings_digest(workspace: "Workspace", manifest: TargetManifest) -> str:
    """Return the digest of what all runs of a target have in common: target, manifest, templates, harness,
    Python, machine and the packages that the harness requires.
    """
    return digest([_SCHEMA, manifest.tree.digest, *surroundings_by_name(workspace, manifest).values()])


def surroundings_by_name(workspace: "Workspace", manifest: TargetManifest) -> dict[str, str]:
    """Return the digests of what all runs of a target have in common, but for the target itself, by what it
    is.
    """
    importer = TRACE_IMPORTER_DOOR.other_package_of(Path(manifest.trace_file).suffix.removeprefix("."))
    packages = {*run_environment.required_packages(), *([importer] if importer else [])}
    machine = (platform.system(), platform.machine(), run_environment.processor_name())
    values = {
        "the manifest": digest(read_bounded(manifest.path)),
        "the templates": workspace.fault_models().digest,
        "the severity scale": as_json_types(workspace.scale_of(manifest)),
        "mutator": harness_digest(),
        "Python": run_environment.python_version(),
        "the machine": [machine, run_environment.loaded_blas(), run_environment.thread_limits()],
        "a package that mutator requires": run_environment.package_versions(packages),
    }
    return {name: digest(value) for name, value in values.items()}


@lru_cache(maxsize=1)
def harness_digest() -> str:
    """Return the digest of the harness's code, without the packages that only show results."""
    return digest(
        [(path.relative_to(_HARNESS_FOLDER).as_posix(), digest(read_bounded(path))) for path in _code_files()]
    )


def _code_files() -> Iterator[Path]:
    for path in sorted(_HARNESS_FOLDER.rglob("*.py")):
        if path.relative_to(_HARNESS_FOLDER).parts[0] not in _PACKAGES_WITHOUT_EFFECT:
            yield path


def run_key(surroundings: str, experiment: Experiment, tree_digest: str, golden_digest: str) -> str:
    """Return the key of an experiment's run. `tree_digest` is that of the mutated tree, `golden_digest` that
    of the outputs of its fault-free run.
    """
    return digest(
        [
            surroundings,
            tree_digest,
            golden_digest,
            experiment.fault.injections,
            experiment.fault.hold,
            experiment.trigger_as_json,
            experiment.scenario,
            experiment.scenario_digest,
            experiment.changes,
            experiment.seed,
            experiment.after_hazard,
            experiment.end_s,
        ]
    )
