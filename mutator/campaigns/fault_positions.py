"""Where the faults of a run change the user's source: files of the user's repository, and lines in them."""

from dataclasses import dataclass
from pathlib import Path

from mutator.errors import MutatorError
from mutator.model import Fault, Injection
from mutator.mutants.injection_edits import is_in_tree
from mutator.mutants.parsed_files_and_anchors import ParsedFile, parsed_file
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace


@dataclass(frozen=True, slots=True, kw_only=True)
class SourcePosition:
    """The lines of a statement or value: first and last, from 1.

    `path` is relative to the repository; if no repository contains the file, it is absolute.
    """

    path: str
    first_line: int
    last_line: int

    @property
    def is_in_repository(self) -> bool:
        return not self.path.startswith("/")

    def __str__(self) -> str:
        return f"{self.path}:{self.first_line}"


@dataclass(frozen=True)
class FaultPositions:
    """The positions of faults in a target's files."""

    manifest: TargetManifest

    @classmethod
    def of_run(cls, folder: RunFolder, workspace: Workspace) -> "FaultPositions":
        """Return the positions of a run's faults; MutatorError if the target has changed since the run."""
        manifest = workspace.manifest_of(folder.head)
        if manifest.tree.digest != folder.head.sources["target"]:
            raise MutatorError(
                f"the target in {manifest.root} has changed since this run was planned",
                where=folder.path,
                expected="the source that the run had, because lines must match",
                remedy="restore it, or name its folder with `target`",
            )
        return cls(manifest)

    def of_fault(self, fault: Fault) -> tuple[SourcePosition, ...]:
        """Return the position of each injection, in the order of the spec."""
        return tuple(map(self._of_injection, fault.injections))

    def _of_injection(self, injection: Injection) -> SourcePosition:
        if not is_in_tree(injection, self.manifest.tree):
            return SourcePosition(path=injection.location.path, first_line=1, last_line=1)
        file = parsed_file(self.manifest.tree, injection.location.path)
        first_line, last_line = numbered_lines(file, injection)
        path = path_in_repository(file.full_path)
        return SourcePosition(path=path, first_line=first_line, last_line=last_line)


def numbered_lines(file: ParsedFile, injection: Injection) -> tuple[int, int]:
    """Return the first and the last line of the injection's statement or value, from 1. At the entry of a
    function, both are the line below the insertion.
    """
    first_index, end_index = file.line_span(injection.location)
    first_line = min(first_index + 1, len(file.lines))
    return first_line, max(first_line, end_index)


def path_in_repository(path: Path) -> str:
    """Return the path of a file relative to the repository that contains it, else to the current folder; an
    absolute path if the file is in neither.
    """
    file = path.resolve()
    folder = next((above for above in file.parents if (above / ".git").exists()), Path.cwd())
    return file.relative_to(folder).as_posix() if file.is_relative_to(folder) else file.as_posix()
