"""The harness's own files: schemas are checked on reading, and files are written whole or not at all."""

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

from mutator.errors import EXIT_HARNESS_ERRORS, MutatorError

_NO_SPACE = (errno.ENOSPC, errno.EDQUOT)
_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW
_NO_FILE = (errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.ELOOP, errno.ENXIO)


class DiskFull(MutatorError):
    """No space left. What finished is kept, and the same command goes on once there is room."""

    exit_code = EXIT_HARNESS_ERRORS


def is_disk_full(err: BaseException | None) -> bool:
    """Whether an error came of a full disk or quota, be it in the words of another library."""
    seen: list[BaseException] = []  # a chain of causes may be a circle
    while err is not None and not any(err is one for one in seen):
        if getattr(err, "errno", None) in _NO_SPACE or any(os.strerror(n) in str(err) for n in _NO_SPACE):
            return True
        seen.append(err)
        err = err.__cause__ or err.__context__
    return False


def is_no_file(err: OSError) -> bool:
    """Whether there is no file in a place, but nothing, a folder, a dangling link, a pipe or a socket."""
    return err.errno in _NO_FILE


def no_pipe(path: Path) -> Path:
    """The path; OSError (`is_no_file`) where there is a pipe, a socket or a device: who reads one may wait
    for ever, or get no end of it."""
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise OSError(errno.ENXIO, os.strerror(errno.ENXIO), str(path))
    return path


def disk_full(where: str | Path | None) -> DiskFull:
    return DiskFull(
        "no space left on this disk",
        where=where,
        remedy="make room and give the same command again; finished experiments are kept and not repeated",
    )


@contextmanager
def raising_disk_full(where: Path) -> Iterator[None]:
    """Turn what a full disk makes of other code into DiskFull."""
    try:
        yield
    except MutatorError:
        raise
    except Exception as err:
        if is_disk_full(err):
            raise disk_full(where) from err
        raise


def check_is_text(path: Path) -> None:
    """MutatorError for a path with bytes that are no text here: neither digests nor tables could hold it."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise MutatorError(
            f"the name {path.name!a} cannot be encoded in this environment",
            where=path,
            expected=f"UTF-8, and an environment that says so (it says {sys.getfilesystemencoding()})",
            remedy="set LC_ALL=C.UTF-8, or PYTHONUTF8=1; or rename it",
        ) from None


def make_folder(path: Path) -> None:
    """Make a folder to write into, and its parents; MutatorError when that fails."""
    check_is_text(path.absolute())
    try:
        with raising_disk_full(path):
            path.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=path):
                return
    except OSError as err:
        raise MutatorError(
            f"cannot be written ({err.strerror})",
            where=path,
            argument="out",
            expected="a folder that you may write to",
            remedy="choose another `out`",
        ) from None


def remove_folder(path: Path) -> None:
    """Delete a folder that a run has written to, as far as one may: however deep it is, and locked or not.

    `shutil.rmtree` calls itself for each level, and fails at some hundred of them.
    """
    if path.is_symlink():
        return
    with suppress(OSError):
        here = _opened(str(path))
        way = [("", _emptied(here))]  # each folder on the way down, and the folders that are left in it
        try:
            while way:
                name, left = way[-1]
                if left:
                    with suppress(OSError):
                        below = left.pop()
                        here = _instead(here, _opened(below, here))
                        way.append((below, _emptied(here)))
                    continue
                way.pop()
                if way:
                    here = _instead(here, os.open("..", _FOLDER, dir_fd=here))
                    with suppress(OSError):
                        os.rmdir(name, dir_fd=here)
        finally:
            os.close(here)
        path.rmdir()


class ScratchFolder:
    """A new temporary folder for runs to write to; it is gone with this object, whatever they left in it."""

    def __init__(self, prefix: str) -> None:
        self.path = Path(tempfile.mkdtemp(prefix=prefix)).resolve()
        self._end = weakref.finalize(self, remove_folder, self.path)

    def __enter__(self) -> Path:
        return self.path

    def __exit__(self, *error: object) -> None:
        self._end()


def _opened(name: str, parent: int | None = None) -> int:
    """A folder, unlocked."""
    with suppress(OSError):
        os.chmod(name, stat.S_IRWXU, dir_fd=parent)
    return os.open(name, _FOLDER, dir_fd=parent)


def _instead(old: int, new: int) -> int:
    os.close(old)
    return new


def _emptied(folder: int) -> list[str]:
    """Delete all that is in an open folder but for folders: their names."""
    with os.scandir(folder) as entries:
        found = [(entry.name, entry.is_dir(follow_symlinks=False)) for entry in entries]
    for name, is_folder in found:
        with suppress(OSError):
            if not is_folder:
                os.unlink(name, dir_fd=folder)
    return [name for name, is_folder in found if is_folder]


def write_atomic(path: Path, data: bytes) -> None:
    """Write the whole file or leave the old one; DiskFull if there is no room, MutatorError for a folder."""
    with half_written(path) as temporary:
        temporary.write_bytes(data)


@contextmanager
def half_written(path: Path) -> Iterator[Path]:
    """Where to write what is to become the file at `path`, in pieces: as `write_atomic`, it does at the end,
    unless something was raised."""
    if path.is_dir():
        raise MutatorError("a folder", where=path, expected="a file to write", remedy="name a file in it")
    temporary = path.with_name(f".{path.name}.{threading.get_native_id()}")
    with raising_disk_full(path):
        try:
            yield temporary
            with temporary.open("rb+") as file:
                os.fsync(file.fileno())
            temporary.replace(path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise


@contextmanager
def writing_atomic(path: Path) -> Iterator[BinaryIO]:
    """As `half_written`, opened for writing."""
    with half_written(path) as temporary, temporary.open("wb") as file:
        yield file


def is_half_written(name: str) -> bool:
    """Whether a file of that name was left by a killed `write_atomic` or `half_written`."""
    return complete(name) != name


def complete(name: str) -> str:
    """The name that such a file was to get; any other name as it is."""
    found = re.fullmatch(r"\.(.+)\.\d+", name)
    return found[1] if found else name


def write_json(path: Path, data: dict[str, Any]) -> None:
    """Write `data` (which names its schema) for people and programs."""
    write_atomic(path, json_bytes(data))


def json_bytes(data: dict[str, Any]) -> bytes:
    """What `write_json` writes."""
    return (json.dumps(data, indent=1, ensure_ascii=False) + "\n").encode()


def read_json(path: Path, schema: str) -> dict[str, Any]:
    """Read a JSON object of `schema` (`name/version`) or an older version of it."""
    try:
        data = json.loads(no_pipe(path).read_bytes())
    except OSError as err:
        if not is_no_file(err):
            raise
        got = "no such file" if isinstance(err, FileNotFoundError) else f"no file ({err.strerror})"
        raise MutatorError(got, where=path) from None
    except (ValueError, RecursionError) as err:
        raise MutatorError(f"not JSON ({err})", where=path, remedy="delete it if it is damaged") from None
    if not isinstance(data, dict):
        raise MutatorError(f"a {type(data).__name__}", where=path, expected="a JSON object")
    check_schema(data.get("schema"), schema, path)
    return data


def check_schema(found: object, schema: str, where: Path) -> None:
    """Refuse anything but `schema` (`name/version`) and older versions of it."""
    name, _, known = schema.partition("/")
    found_name, _, version = str(found).partition("/")
    if found_name != name or not version.isdigit():
        raise MutatorError(f"schema {found!r}", where=where, expected=repr(schema))
    if int(version) > int(known):
        raise MutatorError(
            f"schema {found!r} was written by a newer mutator",
            where=where,
            expected=f"{schema!r} or older",
            remedy="update mutator, or use another folder",
        )
