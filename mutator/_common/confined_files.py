"""Open, write and delete files below a folder that somebody else may have filled.

A run folder, a library, a bundle or a shard can come from anybody. A name in one of its files can point out
of it (`../../setup.py`), and a link in it can point anywhere. So names are checked, and each folder on the
way is opened relative to the one before, without following links: nothing can be exchanged between check and
use. Only `root` itself may be reached through links, because the user named it.

What is only read, and only at the user's side, may use links that stay inside: a library, its templates, a
target's tree (`checked_path_inside`, `files_inside`).
"""

import errno
import os
import stat
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from io import BufferedReader
from pathlib import Path
from typing import BinaryIO

from mutator._common.bounded_reading import read_open_file
from mutator._common.files import open_accessible_folder, raising_disk_full, remove_anything_at
from mutator.errors import MutatorError, UnsafePath

# The kernel refuses a link (O_NOFOLLOW), so that nothing can be exchanged between a look and the opening.
_OPEN_FOLDER_FLAGS = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
# Without O_NONBLOCK, opening a pipe would wait until somebody opens its other end.
_NO_LINK_NO_WAIT_FLAGS = os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
# O_EXCL: a file that somebody puts there meanwhile is not written to.
_NEW_FILE_FLAGS = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
_MOST_DEPTH, _MOST_OUTPUT_DEPTH = 30, 20  # folders in each other; an output lies in a few others
MOST_NAME_BYTES = 220  # bytes; Linux allows 255, and a half-written file has a longer name


def checked_relative_path(name: object, where: str | Path, *, allow_folders: bool = True) -> str:
    """Return `name` if it is a relative path in its shortest form, such as `golden/S1/trace.npz`.

    UnsafePath for anything else, and without `folders` also for several parts. `where` is the file or folder
    that the name comes from.
    """
    text = name if isinstance(name, str) else ""
    parts = text.split("/")
    if (allow_folders or len(parts) == 1) and all(
        part not in ("", ".", "..") and part.isprintable() and _is_short_enough(part) for part in parts
    ):
        return text
    raise UnsafePath(
        f"the name {name!a}",
        where=where,
        expected="the name of a file inside its folder, without `..`, links or unprintable characters",
        remedy="do not use this folder: whoever made it could reach your other files",
    )


def checked_name_not_path(name: str, where: str | Path) -> str:
    """Return the name of a target or scenario of the library; UnsafePath for the path of a YAML file."""
    if not name.endswith((".yaml", ".yml")):
        return name
    raise UnsafePath(
        f"the path {name!a}",
        where=where,
        expected="the name of a file in the library",
        remedy="add the file to the library, and name it without its folder and `.yaml`",
    )


def path_below(root: Path, name: object) -> Path:
    """Join a name that is not a constant of the code to `root`; UnsafePath as in `checked_relative_path`."""
    return root / checked_relative_path(name, root)


def open_below(root: Path, name: str) -> BufferedReader:
    """Open a regular file below `root` for reading.

    FileNotFoundError if it is missing; UnsafePath if it is a link or no regular file, or if a folder on the
    way is a link.
    """
    file = open_descriptor_below(root, name, os.O_RDONLY)
    if not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise not_plain_error(root / name)
    return os.fdopen(file, "rb")


def open_descriptor_below(root: Path, name: str, flags: int) -> int:
    """Return a descriptor of anything but a link, for the caller to check and close. Opening never blocks."""
    with _open_parent(root, name) as (parent, last_part):
        return os.open(last_part, flags | _NO_LINK_NO_WAIT_FLAGS, 0o644, dir_fd=parent)


def read_below(root: Path, name: str) -> bytes:
    """Return the content of a file; errors as in `open_below` and `read_open_file`."""
    with open_below(root, name) as file:
        return read_open_file(file, root / name)


def write_below(root: Path, name: str, data: bytes) -> None:
    """Write a file as `writing_below` does."""
    with writing_below(root, name) as writer:
        writer.write(data)


@contextmanager
def writing_below(root: Path, name: str) -> Iterator[BinaryIO]:
    """Yield a file to write. It takes its name at the end of the block, and its folders are made.

    What stands in its place is replaced, never written to. UnsafePath if a folder on the way is a link;
    MutatorError if a folder stands in its place.
    """
    with raising_disk_full(root / name), _open_parent(root, name, make=True) as (parent, last_part):
        temporary = f".{last_part}.{threading.get_native_id()}"  # `is_half_written`
        with suppress(FileNotFoundError):
            os.unlink(temporary, dir_fd=parent)
        file = os.open(temporary, _NEW_FILE_FLAGS, 0o644, dir_fd=parent)
        try:
            with os.fdopen(file, "wb") as writer:
                yield writer
                writer.flush()
                os.fsync(file)  # before it takes the name, or a crash could leave an empty file of that name
            os.replace(temporary, last_part, src_dir_fd=parent, dst_dir_fd=parent)
        except BaseException as err:
            with suppress(OSError):
                os.unlink(temporary, dir_fd=parent)
            if isinstance(err, IsADirectoryError):
                what = "a file to write"
                raise MutatorError("a folder", where=root / name, expected=what, remedy="move it") from None
            raise


def unlink_below(root: Path, name: str) -> None:
    """Delete a file or a link, which is not followed; a missing one is ignored."""
    with suppress(FileNotFoundError), _open_parent(root, name) as (parent, last_part):
        os.unlink(last_part, dir_fd=parent)


def move_below(root: Path, name: str, to: str) -> None:
    """Rename a file, folder or link, which is not followed; make the folders of `to`."""
    with _open_parent(root, name) as (parent, last), _open_parent(root, to, make=True) as (there, final):
        os.rename(last, final, src_dir_fd=parent, dst_dir_fd=there)


def check_only_plain_files(root: Path) -> None:
    """Raise UnsafePath if anything below `root` is neither a regular file nor a folder."""
    for _, entry in entries_below(root):
        if not is_file_or_folder(entry):
            raise not_plain_error(Path(entry.path))


def checked_path_inside(root: Path, path: Path) -> Path:
    """Return `path`, a place below `root`; UnsafePath if a link on the way leads out of `root`."""
    if not is_inside(root, path):
        raise UnsafePath(
            "a link that leads out of its folder",
            where=path,
            expected=f"only files and folders of {root}, and links to them",
            remedy="put a copy in its place, or delete it; it would show somebody else's library your files",
        )
    return path


def is_inside(root: Path, path: Path) -> bool:
    """Whether `path`, with all links followed, is `root` or below it. The path need not exist."""
    return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(root))


def files_inside(root: Path, folder: str, pattern: str) -> list[Path]:
    """Return the files below `root`/`folder` whose names match a glob, sorted; linked folders are skipped.

    UnsafePath for a name that `checked_relative_path` refuses, and for a link that leads out of `root`.
    """
    base = checked_path_inside(root, root / folder)
    files = sorted(path for path in base.rglob(pattern) if not path.is_dir())
    for path in files:
        checked_relative_path(path.relative_to(root).as_posix(), base)
        if path.is_symlink():
            checked_path_inside(root, path)
    return files


def entries_below(
    root: Path, should_not_enter: Callable[[str], bool] = lambda name: False
) -> Iterator[tuple[str, os.DirEntry[str]]]:
    """Yield everything below `root` with its path from there, but nothing in links, nor in folders
    that `should_not_enter`. What disappears meanwhile is left out.
    """
    folders = [""]
    while folders:
        folder = folders.pop()
        with suppress(FileNotFoundError, NotADirectoryError), os.scandir(f"{root}/{folder}") as entries:
            for entry in entries:
                name = f"{folder}{entry.name}"
                yield name, entry
                if entry.is_dir(follow_symlinks=False) and not should_not_enter(name):
                    folders.append(f"{name}/")


def move_plain_files(source_fd: int, target_fd: int, depth: int = 0) -> None:
    """Move regular files between open folders, whoever can change the first one meanwhile.

    Folders are made anew. Links, pipes and the like, unprintable names and deep folders stay behind.
    """
    if depth >= _MOST_OUTPUT_DEPTH:
        return
    with suppress(OSError):  # a run can take its user the permission to list a folder
        os.fchmod(source_fd, stat.S_IRWXU)
    with os.scandir(source_fd) as entries:
        names = [entry.name for entry in entries if entry.name.isprintable()]
    for name in sorted(names):
        with suppress(FileNotFoundError, NotADirectoryError):
            kind = _file_type(source_fd, name)
            if kind == stat.S_IFREG:
                os.rename(name, name, src_dir_fd=source_fd, dst_dir_fd=target_fd)
                if _file_type(target_fd, name) != stat.S_IFREG:  # exchanged between look and move
                    remove_anything_at(Path(f"/proc/self/fd/{target_fd}", name))
            elif kind == stat.S_IFDIR:
                os.mkdir(name, dir_fd=target_fd)
                with open_folder(name, source_fd) as below, open_folder(name, target_fd) as there:
                    move_plain_files(below, there, depth + 1)


@contextmanager
def open_folder(name: str | Path, parent: int | None = None) -> Iterator[int]:
    """Yield a descriptor of a folder; NotADirectoryError for anything else, also for a link."""
    handle = open_accessible_folder(name, parent)
    try:
        yield handle
    finally:
        os.close(handle)


def _file_type(folder: int, name: str) -> int:
    return stat.S_IFMT(os.stat(name, dir_fd=folder, follow_symlinks=False).st_mode)


def is_too_deep(name: str) -> bool:
    """Whether a path has more folders than anything that belongs there; readers would recurse too deeply."""
    return name.count("/") >= _MOST_DEPTH


def is_file_or_folder(entry: os.DirEntry[str]) -> bool:
    """Whether an entry is a regular file or a folder, or has disappeared."""
    kinds = entry.is_file(follow_symlinks=False), entry.is_dir(follow_symlinks=False)
    return any(kinds) or not os.path.lexists(entry.path)


@contextmanager
def _open_parent(root: Path, name: str, *, make: bool = False) -> Iterator[tuple[int, str]]:
    """Open the folder that contains `name`; yield its descriptor and the last part of the name."""
    *folders, last = checked_relative_path(name, root).split("/")
    handle = os.open(root, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        for part in folders:
            if make:
                with suppress(FileExistsError):
                    os.mkdir(part, dir_fd=handle)
            inner = os.open(part, _OPEN_FOLDER_FLAGS, dir_fd=handle)
            os.close(handle)
            handle = inner
        yield handle, last
    except OSError as err:
        if err.errno in (errno.ELOOP, errno.ENOTDIR, errno.ENXIO):
            raise not_plain_error(root / name) from None
        raise
    finally:
        os.close(handle)


def not_plain_error(path: Path) -> UnsafePath:
    """Return the error about a link, a pipe and the like, for the caller to raise."""
    return UnsafePath(
        "a link, a pipe or something else that is not a plain file",
        where=path,
        expected="only files and folders",
        remedy="delete it, or use a copy of the folder without it",
    )


def _is_short_enough(part: str) -> bool:
    try:
        return len(part.encode()) <= MOST_NAME_BYTES
    except UnicodeEncodeError:
        return False
