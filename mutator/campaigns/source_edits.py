"""Notice edits of the files from which a campaign is made, in whatever way an editor writes them.

Asking is cheap: the states of files and folders are compared. Only if one differs are files listed and read
again, so that temporary files of editors, and files that are written with the same content, are no edit.
"""

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import path_below
from mutator._common.hashing import digest
from mutator.campaigns.campaign_files import load_campaign
from mutator.errors import MutatorError
from mutator.workspace import Workspace

# of editors and version control: `.x.swp`, `x~`, `#x#`, `x.tmp`, and vim's `4913`
_TEMPORARY_PATTERN = re.compile(r"[.#].*|.*~|.*\.(?:tmp|bak|orig|pyc)|\d+|__pycache__")
_FOLDERS_WITHOUT_SOURCES = ("reviews", "runs")
_PathState = tuple[int, int, int] | None  # None: no such file


class SourceEdits:
    """The files of a campaign: library, templates, target, and the campaign's own file."""

    def __init__(self, workspace: Workspace, campaign: str | Path) -> None:
        self._workspace, self._campaign = workspace, campaign
        self._target_files: set[Path] = set()  # of the last manifest that could be read
        self._digests: dict[Path, str] = {}
        self._states: dict[Path, _PathState] = {}
        self.find()

    def find(self) -> tuple[Path, ...]:
        """Return the files that are changed, new or gone since the last call, sorted."""
        if self._states and all(_state_of(path) == state for path, state in self._states.items()):
            return ()
        before_states, before_digests = self._states, self._digests
        files = set(self._files())
        # states come first: what is written after that differs from them
        self._states = {path: _state_of(path) for path in files | {file.parent for file in files}}
        self._states |= {folder: _state_of(folder) for folder in self._folders()}
        self._digests = {
            path: before_digests[path]
            if path in before_digests and before_states.get(path) == self._states[path]
            else _digest_of(path)
            for path in files
        }
        paths = before_digests.keys() | self._digests.keys()
        return tuple(sorted(p for p in paths if before_digests.get(p) != self._digests.get(p)))

    def _files(self) -> Iterator[Path]:
        for folder in self._folders():
            with suppress(OSError), os.scandir(folder) as entries:
                yield from (
                    Path(entry.path) for entry in entries if _is_source(entry.name) and entry.is_file()
                )
        with suppress(MutatorError, OSError):  # somebody is in the middle of an edit
            campaign = load_campaign(self._workspace.campaign(self._campaign))
            yield campaign.path.absolute()
            selections = campaign.fault_selections
            yield from (s.spec_file.absolute() for s in selections if s.spec_file)
            manifest = self._workspace.manifest(campaign.target)
            tree = manifest.tree
            self._target_files = {
                path_below(tree.overlay if tree.overlay and name in tree.overlaid_paths else tree.root, name)
                for name in tree.files
            }
        yield from self._target_files

    def _folders(self) -> Iterator[Path]:
        for root in (self._workspace.library, self._workspace.templates):
            for folder, folders, _ in os.walk(root.absolute()):
                yield Path(folder)
                folders[:] = [n for n in folders if _is_source(n) and n not in _FOLDERS_WITHOUT_SOURCES]


def describe_edits(paths: Iterable[Path], folder: Path) -> str:
    """Return the names of edited files relative to `folder`, or whole: the first three, and how many more."""
    names = [str(path.relative_to(folder) if path.is_relative_to(folder) else path) for path in paths]
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return f"{', '.join(names[:3])}{more}"


def _is_source(name: str) -> bool:
    return not _TEMPORARY_PATTERN.fullmatch(name)


def _state_of(path: Path) -> _PathState:
    try:
        state = path.stat()
    except OSError:
        return None
    return state.st_ino, state.st_size, state.st_mtime_ns


def _digest_of(path: Path) -> str:
    try:
        return digest(read_bounded(path))
    except (OSError, MutatorError):
        return ""
