"""Delete the files that a run wrote into its folder, and no others."""

import os
import time
from collections.abc import Iterable
from contextlib import suppress
from fnmatch import fnmatchcase
from pathlib import Path

from mutator._common.confined_files import unlink_below
from mutator._common.extension_doors import EXPORT_DOOR
from mutator._common.files import final_name_of_half_written, is_half_written, read_json, remove_folder
from mutator._common.folder_locks import lock_run_folder
from mutator.errors import MutatorError
from mutator.store.allowed_contents import ALLOWED_FILE_GLOBS, ALLOWED_TOP_FOLDERS
from mutator.store.plain_contents_check import check_plain_contents, is_unchecked_folder
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import HEAD, RUN_SCHEMA

_MOST_NAMES_SHOWN = 3
_DELETION_TRIES, _RETRY_PAUSE_S = 50, 0.1  # 5 s in all: a large run has thousands of files


def delete_run(path: Path) -> None:
    """Delete the run folder. MutatorError as in `list_deletable_files`, or if a command or its workers use
    it.
    """
    list_deletable_files(path)
    with lock_run_folder(path, patience_s=0.0):
        files = list_deletable_files(path)  # check again, because now nobody else can write to the folder
        _delete_files(path, sorted(files, key=lambda file: file == path / HEAD))  # run.json is deleted last


def delete_unfinished_run(path: Path) -> None:
    """Delete the files that a killed command left in an unfinished run folder, and no other files.

    run.json is deleted first. Half-written files, which show that a command was killed, are deleted last.
    """
    run_files, _ = _split_by_origin(path)
    _delete_files(path, sorted(run_files, key=lambda file: (is_half_written(file.name), file != path / HEAD)))


def finish_deletion(path: Path) -> bool:
    """Wait for a command that might be deleting the run folder, then delete files written in the meantime.

    Return whether the folder is gone.
    """
    for _ in range(_DELETION_TRIES):
        try:
            with lock_run_folder(path, patience_s=0.0):
                if RunFolder.exists(path):
                    return False
                delete_unfinished_run(path)
        except FileNotFoundError:
            return True
        except MutatorError:  # the folder is still in use
            time.sleep(_RETRY_PAUSE_S)
        else:
            return True
    return False


def _delete_files(path: Path, files: Iterable[Path]) -> None:
    for file in files:
        if is_unchecked_folder(file.relative_to(path).as_posix()):
            remove_folder(file)
        else:
            unlink_below(path, file.relative_to(path).as_posix())
    for folder, _, _ in os.walk(path, topdown=False):
        with suppress(OSError):
            Path(folder).rmdir()


def list_deletable_files(path: Path) -> list[Path]:
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
    check_plain_contents(path)
    read_json(path / HEAD, RUN_SCHEMA)
    run_files, other_entries = _split_by_origin(path)
    if other_entries:
        names = [str(entry.relative_to(path)) for entry in sorted(other_entries)]
        more = f" and {len(names) - _MOST_NAMES_SHOWN} more" if len(names) > _MOST_NAMES_SHOWN else ""
        raise MutatorError(
            f"contains files that no run writes: {', '.join(names[:_MOST_NAMES_SHOWN])}{more}",
            where=path,
            expected="only files that a run writes",
            remedy="move them elsewhere, or delete the folder yourself",
        )
    return run_files


def _run_file_globs() -> tuple[str, ...]:
    """Return the patterns of all files that a run folder can contain, also in formats of other packages.

    An export that is one file for the whole run is named after its format.
    """
    return (*ALLOWED_FILE_GLOBS, *(f"exports/{name}.*" for name in EXPORT_DOOR.names()))


def _matches_any(name: str, patterns: Iterable[str]) -> bool:
    whole = Path(name).with_name(final_name_of_half_written(Path(name).name)).as_posix()
    return any(fnmatchcase(whole, pattern) for pattern in patterns)


def _split_by_origin(path: Path) -> tuple[list[Path], list[Path]]:
    """Separate the files and scratch folders below `path` that a run wrote from other entries. Links are
    not followed.
    """
    run_files: list[Path] = []
    other_entries: list[Path] = []
    patterns = _run_file_globs()
    for folder, folders, files in os.walk(path):
        for name in (*files, *folders):
            entry = Path(folder, name)
            relative_name = entry.relative_to(path).as_posix()
            is_folder = name in folders and not entry.is_symlink()
            if (
                is_folder
                and not is_unchecked_folder(relative_name)
                and relative_name.partition("/")[0] in ALLOWED_TOP_FOLDERS
            ):
                continue
            if (
                is_unchecked_folder(relative_name)
                if is_folder
                else _matches_any(relative_name, patterns) and not entry.is_symlink()
            ):
                run_files.append(entry)
            else:
                other_entries.append(entry)
            folders[:] = [other for other in folders if other != name]
    return run_files, other_entries
