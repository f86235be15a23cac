"""Delete the files that a run wrote into its folder, and no others."""

import os
import time
from collections.abc import Iterable
from contextlib import suppress
from fnmatch import fnmatchcase
from pathlib import Path

from mutator._common.below import unlink_below
from mutator._common.doors import EXPORTS
from mutator._common.files import complete, is_half_written, read_json, remove_folder
from mutator._common.locks import owned
from mutator.errors import MutatorError
from mutator.store.allowed_contents import CONTENT, FOLDERS, check_contents, is_closed
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import HEAD, SCHEMA

_SHOWN = 3
_TRIES, _PAUSE_S = 50, 0.1


def clean(path: Path) -> None:
    """Delete the run folder. MutatorError as in `check`, or if a command or its workers use it."""
    check(path)
    with owned(path, patience_s=0.0):
        found = check(path)  # check again, because now nobody else can write to the folder
        _delete(path, sorted(found, key=lambda file: file == path / HEAD))  # run.json is deleted last


def clear(path: Path) -> None:
    """Delete the files that a killed command left in an unfinished run folder, and no other files.

    run.json is deleted first. Half-written files, which show that a command was killed, are deleted last.
    """
    ours, _ = _sorted_out(path)
    _delete(path, sorted(ours, key=lambda file: (is_half_written(file.name), file != path / HEAD)))


def finish_deletion(path: Path) -> bool:
    """Wait for a command that might be deleting the run folder, then delete files written in the meantime.

    Return whether the folder is gone.
    """
    for _ in range(_TRIES):
        try:
            with owned(path, patience_s=0.0):
                if RunFolder.exists(path):
                    return False
                clear(path)
        except FileNotFoundError:
            return True
        except MutatorError:  # the folder is still in use
            time.sleep(_PAUSE_S)
        else:
            return True
    return False


def _delete(path: Path, files: Iterable[Path]) -> None:
    for file in files:
        if is_closed(file.relative_to(path).as_posix()):
            remove_folder(file)
        else:
            unlink_below(path, file.relative_to(path).as_posix())
    for folder, _, _ in os.walk(path, topdown=False):
        with suppress(OSError):
            Path(folder).rmdir()


def check(path: Path) -> list[Path]:
    """List the files of a run folder.

    MutatorError if the path is a link or not a run folder, or if it contains files that no run writes.
    """
    if path.is_symlink():
        raise MutatorError(
            f"a link to {path.readlink()}",
            where=path,
            expected="a run folder, not a link to one",
            remedy="name the link's target",
        )
    if not RunFolder.exists(path):
        raise MutatorError(
            "not a run folder (it has no run.json)",
            where=path,
            expected="a run folder",
            remedy="delete it yourself",
        )
    check_contents(path)
    read_json(path / HEAD, SCHEMA)
    ours, strangers = _sorted_out(path)
    if strangers:
        names = [str(entry.relative_to(path)) for entry in sorted(strangers)]
        more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
        raise MutatorError(
            f"contains files that no run writes: {', '.join(names[:_SHOWN])}{more}",
            where=path,
            expected="only files that a run writes",
            remedy="move them elsewhere, or delete the folder yourself",
        )
    return ours


def _patterns() -> tuple[str, ...]:
    """Return the patterns of all files that a run folder can contain, also in formats of other packages.

    An export that is one file for the whole run is named after its format.
    """
    return (*CONTENT, *(f"exports/{name}.*" for name in EXPORTS.names()))


def _matches(name: str, patterns: Iterable[str]) -> bool:
    whole = Path(name).with_name(complete(Path(name).name)).as_posix()
    return any(fnmatchcase(whole, pattern) for pattern in patterns)


def _sorted_out(path: Path) -> tuple[list[Path], list[Path]]:
    """Separate the files and scratch folders below `path` that a run wrote from other entries. Links are
    not followed.
    """
    ours: list[Path] = []
    strangers: list[Path] = []
    patterns = _patterns()
    for folder, folders, files in os.walk(path):
        for name in (*files, *folders):
            entry = Path(folder, name)
            words = entry.relative_to(path).as_posix()
            is_folder = name in folders and not entry.is_symlink()
            if is_folder and not is_closed(words) and words.partition("/")[0] in FOLDERS:
                continue
            if is_closed(words) if is_folder else _matches(words, patterns) and not entry.is_symlink():
                ours.append(entry)
            else:
                strangers.append(entry)
            folders[:] = [other for other in folders if other != name]
    return ours, strangers
