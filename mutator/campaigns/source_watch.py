"""Notice that somebody edits the files from which a bench makes its experiments, while it is open."""

from collections.abc import Iterable
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import path_below
from mutator._common.hashing import digest
from mutator.errors import MutatorError
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

_FileState = tuple[int, int, int]
_LIBRARY_GLOBS = ("faults/**/*.yaml", "severity/*.yaml", "readings.yaml")


class SourceWatch:
    """The files that must stay as they are: target, manifest, templates, fault specs, and added ones."""

    def __init__(self, workspace: Workspace, manifest: TargetManifest) -> None:
        self._states: dict[Path, _FileState] = {}
        self._digests: dict[Path, str] = {}
        tree = manifest.tree
        for name, data in tree.files.items():
            folder = tree.overlay if tree.overlay and name in tree.overlaid_paths else tree.root
            self._note(path_below(folder, name), digest(data))
        library_files = (path for glob in _LIBRARY_GLOBS for path in workspace.library.glob(glob))
        templates = (
            path for path in workspace.templates.rglob("*") if path.suffix in (".yaml", ".j2", ".py")
        )
        self.add((manifest.path, *library_files, *templates))

    def add(self, paths: Iterable[Path]) -> None:
        """Watch these files, too."""
        for path in paths:
            if path not in self._digests and path.is_file():
                self._note(path, digest(read_bounded(path)))

    def digest_of(self, path: Path) -> str:
        """Return the digest of a watched file, as it was when it was added."""
        return self._digests[path]

    def check_unchanged(self) -> None:
        """Raise MutatorError, with the file's name, if a file has another content or is gone."""
        for path, state in self._states.items():
            try:
                is_same = _state_of(path) == state or digest(read_bounded(path)) == self._digests[path]
            except OSError:
                is_same = False
            if not is_same:
                raise MutatorError(
                    "changed while the bench was open",
                    where=path,
                    expected="the same library, templates and target for all batches",
                    remedy="undo the change, or open another bench in another folder",
                )

    def _note(self, path: Path, content_digest: str) -> None:
        self._states[path], self._digests[path] = _state_of(path), content_digest


def _state_of(path: Path) -> _FileState:
    state = path.stat()
    return state.st_ino, state.st_size, state.st_mtime_ns
