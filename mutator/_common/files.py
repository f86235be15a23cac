"""Read and write the harness's own files. Reads check schemas, and writes are atomic."""

import errno
import json
import os
import re
import stat
import sys
import tempfile
import threading
import weakref
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

from mutator._common.bounded_reading import MOST_RUN_JSON_BYTES, read_bounded
from mutator.errors import DiskFull, MutatorError

_DISK_FULL_ERRNOS = (errno.ENOSPC, errno.EDQUOT)  # the disk, or the user's quota of it
_OPEN_FOLDER_FLAGS = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW
# missing; below a file; a folder; a circle of links; a pipe, socket or device
_NO_FILE_ERRNOS = (errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.ELOOP, errno.ENXIO)


def is_disk_full_error(err: BaseException | None) -> bool:
    """Whether a full disk or quota caused an error, even if a library wraps or rewords it."""
    visited: list[BaseException] = []  # a chain of causes can be circular
    while err is not None and not any(err is cause for cause in visited):
        if getattr(err, "errno", None) in _DISK_FULL_ERRNOS or any(
            os.strerror(n) in str(err) for n in _DISK_FULL_ERRNOS
        ):
            return True
        visited.append(err)
        err = err.__cause__ or err.__context__
    return False


def is_no_file_error(err: OSError) -> bool:
    """Whether an error means that a path holds no regular file."""
    return err.errno in _NO_FILE_ERRNOS


def disk_full_error(where: str | Path | None) -> DiskFull:
    return DiskFull(
        "no space left on this disk",
        where=where,
        remedy="make room and run the same command again; finished experiments are kept and not repeated",
    )


@contextmanager
def raising_disk_full(where: Path) -> Iterator[None]:
    """Convert the errors that a full disk causes into DiskFull."""
    try:
        yield
    except MutatorError:
        raise
    except Exception as err:
        if is_disk_full_error(err):
            raise disk_full_error(where) from err
        raise


def check_path_encodable(path: Path) -> None:
    """Raise MutatorError for a path that this environment cannot encode, because digests and tables contain
    paths.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise MutatorError(
            f"the name {path.name!a} cannot be encoded in this environment",
            where=path,
            expected=f"UTF-8 names and a UTF-8 environment (this one uses {sys.getfilesystemencoding()})",
            remedy="set LC_ALL=C.UTF-8 or PYTHONUTF8=1, or rename the file",
        ) from None


def make_folder(path: Path) -> None:
    """Make a writable folder and its parents; MutatorError if that fails."""
    check_path_encodable(path.absolute())
    try:
        with raising_disk_full(path):
            path.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=path):  # only this shows that one can write there
                return
    except OSError as err:
        raise MutatorError(
            f"cannot be written ({err.strerror})",
            where=path,
            argument="out",
            expected="a folder that you can write to",
            remedy="choose another `out`",
        ) from None


def remove_folder(path: Path) -> None:
    """Delete a folder that a run wrote to, as far as permissions allow, even if it is nested deeply or
    read-only.

    `shutil.rmtree` recurses, and fails at a depth of a few hundred folders. If a process moves or exchanges
    folders meanwhile, nothing outside is deleted or changed.
    """
    if path.is_symlink():
        return
    with suppress(OSError):
        here = open_accessible_folder(str(path))
        stack = [
            ("", _delete_files_and_list_folders(here), _folder_identity(here))
        ]  # folders on the way down, with remaining subfolders
        try:
            while stack:
                name, subfolders, _ = stack[-1]
                if subfolders:
                    with suppress(OSError):
                        below = subfolders.pop()
                        here = _swap_descriptor(here, open_accessible_folder(below, here))
                        stack.append((below, _delete_files_and_list_folders(here), _folder_identity(here)))
                    continue
                stack.pop()
                if stack:
                    here = _swap_descriptor(here, os.open("..", _OPEN_FOLDER_FLAGS, dir_fd=here))
                    if _folder_identity(here) != stack[-1][2]:
                        return  # the folder was moved, so its parent is another one
                    with suppress(OSError):
                        os.rmdir(name, dir_fd=here)
        finally:
            os.close(here)
        path.rmdir()


def remove_anything_at(path: Path) -> None:
    """Delete whatever is at this place: a folder with its content, or a file or link."""
    remove_folder(path)
    with suppress(FileNotFoundError, NotADirectoryError, IsADirectoryError, PermissionError):
        path.unlink()


class ScratchFolder:
    """A temporary folder for runs to write to, in `parent` (None: the system's), deleted together with this
    object.
    """

    def __init__(self, prefix: str, parent: Path | None = None) -> None:
        self.path = Path(tempfile.mkdtemp(prefix=prefix, dir=parent)).resolve()
        self._end = weakref.finalize(self, remove_folder, self.path)

    def __enter__(self) -> Path:
        return self.path

    def __exit__(self, *error: object) -> None:
        self._end()


def open_accessible_folder(name: str | Path, parent: int | None = None) -> int:
    """Return a descriptor of a folder that this user can list and change, as far as permissions allow.

    NotADirectoryError for anything else, also for a link.
    """
    try:
        folder = os.open(name, _OPEN_FOLDER_FLAGS, dir_fd=parent)
    except PermissionError:
        make_accessible(name, parent)
        return os.open(name, _OPEN_FOLDER_FLAGS, dir_fd=parent)
    if os.fstat(folder).st_mode & stat.S_IRWXU != stat.S_IRWXU:
        with suppress(OSError):
            os.fchmod(folder, stat.S_IRWXU)
    return folder


def make_accessible(name: str | Path, parent: int | None = None) -> None:
    """Let this user list and change a folder; OSError for a link."""
    place = os.open(name, os.O_PATH | os.O_DIRECTORY | os.O_NOFOLLOW, dir_fd=parent)
    try:
        Path(f"/proc/self/fd/{place}").chmod(stat.S_IRWXU)  # fchmod refuses O_PATH
    finally:
        os.close(place)


def _folder_identity(folder: int) -> tuple[int, int]:
    state = os.fstat(folder)
    return state.st_dev, state.st_ino


def _swap_descriptor(old: int, new: int) -> int:
    os.close(old)
    return new


def _delete_files_and_list_folders(folder: int) -> list[str]:
    """Delete everything in an open folder except subfolders; return their names."""
    with os.scandir(folder) as entries:
        children = [(entry.name, entry.is_dir(follow_symlinks=False)) for entry in entries]
    for name, is_folder in children:
        with suppress(OSError):
            if not is_folder:
                os.unlink(name, dir_fd=folder)
    return [name for name, is_folder in children if is_folder]


def write_atomic(path: Path, data: bytes) -> None:
    """Write the whole file, or leave the old file unchanged; raise DiskFull if there is no room, MutatorError
    if the path is a folder.
    """
    with writing_temporary_path(path) as temporary:
        temporary.write_bytes(data)


@contextmanager
def writing_temporary_path(path: Path) -> Iterator[Path]:
    """Yield a temporary path to write to. The file there is renamed to `path` unless the block raises."""
    if path.is_dir():
        raise MutatorError("a folder", where=path, expected="a file to write", remedy="name a file in it")
    temporary = path.with_name(f".{path.name}.{threading.get_native_id()}")
    with raising_disk_full(path):
        try:
            yield temporary
            with temporary.open("rb+") as file:
                os.fsync(file.fileno())  # otherwise a crash could leave an empty file of this name
            temporary.replace(path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise


@contextmanager
def writing_atomic(path: Path) -> Iterator[BinaryIO]:
    """Like `writing_temporary_path`, but yield a file opened for writing."""
    with writing_temporary_path(path) as temporary, temporary.open("wb") as file:
        yield file


def is_half_written(name: str) -> bool:
    """Whether a file of this name is left over from a killed `write_atomic` or `writing_temporary_path`."""
    return final_name_of_half_written(name) != name


def final_name_of_half_written(name: str) -> str:
    """Return the final name of a half-written file; any other name unchanged."""
    match = re.fullmatch(r"\.(.+)\.\d+", name)
    return match[1] if match else name


def write_json(path: Path, data: dict[str, Any]) -> None:
    """Write `data`, which contains its schema, as JSON."""
    write_atomic(path, json_bytes(data))


def json_bytes(data: dict[str, Any]) -> bytes:
    """Return the bytes that `write_json` writes."""
    return (json.dumps(data, indent=1, ensure_ascii=False) + "\n").encode()


def read_json(path: Path, schema: str) -> dict[str, Any]:
    """Read a JSON object that has the schema `schema` (`name/version`)."""
    try:
        data = read_bounded(path, MOST_RUN_JSON_BYTES)
    except OSError as err:
        if not is_no_file_error(err):
            raise
        got = "no such file" if isinstance(err, FileNotFoundError) else f"not a file ({err.strerror})"
        raise MutatorError(got, where=path) from None
    return parse_json_object(data, path, schema)


def parse_json_object(text: bytes, where: Path, schema: str) -> dict[str, Any]:
    """Parse the content of the file `where`, as `read_json` does."""
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as err:
        raise MutatorError(f"not JSON ({err})", where=where, remedy="delete it if it is damaged") from None
    if not isinstance(data, dict):
        raise MutatorError(f"a {type(data).__name__}", where=where, expected="a JSON object")
    check_schema(data.get("schema"), schema, where)
    return data


def check_schema(
    actual: object, schema: str, where: str | Path, *, line: int | None = None, remedy: str | None = None
) -> None:
    """Raise MutatorError unless `actual`, the schema of the file `where`, is `schema` (`name/version`).

    `remedy` says what to do about another schema than that of a newer version.
    """
    if actual == schema:
        return
    name, _, version = schema.partition("/")
    number = re.fullmatch(rf"{name}/(\d{{1,6}})", str(actual))
    if number and int(number[1]) > int(version):
        remedy = "use a newer version of mutator"
    raise MutatorError(
        "no schema" if actual is None else f"schema {actual!r}",
        where=where,
        line=line,
        expected=schema,
        remedy=remedy or "use the version of mutator that wrote it, or write it anew with this one",
    )
