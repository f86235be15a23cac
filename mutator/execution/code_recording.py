"""Notes what the runs of a worker executed, for later runs with `--since`."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from mutator._common.hashing import digest
from mutator.campaigns import run_environment
from mutator.engines.executed_functions import ExecutedFunctions
from mutator.execution.experiment_runner import RecordedExperiment
from mutator.execution.finished_run_keys import harness_digest, surroundings_by_name
from mutator.execution.loaded_packages import LoadedPackages
from mutator.store.executed_code import ExecutedCode
from mutator.store.run_folder import RunFolder
from mutator.targets.function_digests import MODULE_PART, part_name, parts_of_file
from mutator.targets.manifest import TargetManifest
from mutator.targets.source_tree import SourceTree

if TYPE_CHECKING:
    from mutator.workspace import Workspace

HARNESS_NAME = "mutator"  # its name among the surroundings


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingAssignment:
    """How a worker notes what its runs executed, and what it leaves out.

    * `surroundings`: digests of what all runs of its session have in common, by name
    * `version_by_package`: all installed packages whose version tells what their code is
    * `earlier_run`: the run folder of `--since`; None without it
    """

    surroundings: Mapping[str, str]
    version_by_package: Mapping[str, str | None]
    earlier_run: Path | None = None


def build_recording_assignment(
    workspace: "Workspace", manifest: TargetManifest, earlier_run: RunFolder | None
) -> RecordingAssignment:
    return RecordingAssignment(
        surroundings=surroundings_by_name(workspace, manifest),
        version_by_package=run_environment.versions_of_fixed_packages(),
        earlier_run=earlier_run.path if earlier_run else None,
    )


class CodeRecording:
    """What the runs of one worker execute of the target's tree."""

    def __init__(self, assignment: RecordingAssignment, folder: RunFolder, manifest: TargetManifest) -> None:
        self._surroundings = assignment.surroundings
        # a worker of a bench can begin long after its session, when somebody has edited the harness
        self._is_in_use = assignment.surroundings[HARNESS_NAME] == digest(harness_digest())
        self._tree = manifest.tree
        self.packages = LoadedPackages(folder, assignment.version_by_package)

    def note_new_goldens(self) -> None:
        """Note that the run folder has more golden runs."""
        self.packages.note_new_goldens()

    def code_of(self, finished: RecordedExperiment) -> ExecutedCode | None:
        """Return what an experiment's run executed; None if nothing ran, or if nothing was noted."""
        executed, mutant, packages = finished.executed_functions, finished.mutant, finished.packages
        if executed is None or mutant is None or not self._is_in_use:
            return None
        obstacle = executed.obstacle
        if packages is None:
            packages = self.packages.versions(finished.third_party_modules, mutant)
        if packages is None:
            packages, obstacle = {}, "it loaded a package whose code can change"
        return ExecutedCode(
            parts_by_file={} if obstacle else executed_parts(self._tree, executed),
            files_read={
                path: digest(self._tree.files[path])
                for path in executed.files_read
                if path in self._tree.files
            },
            packages=packages,
            surroundings=self._surroundings,
            obstacle=obstacle,
        )

    def reason_of_surroundings(self, code: ExecutedCode) -> str:
        """Return what a run had that differs here, but for the target itself; empty if nothing does."""
        for name, value in self._surroundings.items():
            if code.surroundings.get(name) != value:
                return f"{name} changed"
        return "" if self.packages.have_versions(code.packages) else "a package that they loaded changed"


def executed_parts(tree: SourceTree, executed: ExecutedFunctions) -> dict[str, dict[str, str]]:
    """Return the digests of the executed parts, by file and name. Files of the probe are left out."""
    parts_by_file = {}
    for path, names in executed.names_by_file.items():
        if path in tree.files:
            parts = parts_of_file(tree, path)
            executed_names = {MODULE_PART, *(part_name(parts, name) for name in names)}
            parts_by_file[path] = {name: parts[name].digest for name in sorted(executed_names)}
    return parts_by_file
