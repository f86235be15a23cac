"""The git clone that a folder is in: its commit, what changed since, and who changed a file last.

A clone can come from anybody, and its configuration can make git run programs: filters, hooks, file monitors,
signature checks, fetches of missing objects. So git reads that configuration only to find the commit, which
runs nothing. All other questions go to an empty repository of the harness's own that borrows the clone's
objects, and the harness itself compares files with the commit.
"""

import hashlib
import os
import stat
import subprocess
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile

from mutator._common.confined_files import open_below
from mutator.errors import MutatorError
from mutator.store.session_environments import GitCloneState

_MOST_GIT_TIME_S = 10.0  # for one answer; a clone on a stalled network folder must not stop a run
_MOST_OUTPUT_BYTES = 32 << 20  # bytes of an answer; a tiny repository can list billions of files
_MOST_EXCLUDE_FILE_BYTES = 1 << 20  # what is cut off excludes nothing, so its files count as changes
_MOST_COMPARED_BYTES = 1 << 30  # hashing a GiB takes seconds, for which every start of a run would wait
_BLOCK_BYTES = 1 << 20  # files are hashed in blocks, to limit memory
_LINK_MODE, _SUBMODULE_MODE = 0o120000, 0o160000  # modes of git
# a bare repository inside a clone brings a configuration of its own; fsmonitor names a program to run
_CAUTIOUS_OPTIONS = ("-c", "safe.bareRepository=explicit", "-c", "core.fsmonitor=false")
_USER_CONFIG_SCOPES = ("system", "global", "command")  # scopes of configuration that no clone can set


@dataclass(frozen=True, slots=True)
class _CommittedFile:
    """A file in a commit: its mode, the hash of its content and, unless it is a submodule, its size."""

    mode: int
    blob: str
    size: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class GitClone:
    """A clone with a commit. `root` is its folder; `hash_name` is `sha1` or `sha256`."""

    root: Path
    commit: str
    hash_name: str
    _objects_folder: Path
    _shallow_file: Path
    _exclude_file_bytes: bytes

    @classmethod
    def find(cls, folder: Path) -> "GitClone | None":
        """Return the clone that a folder is in; None without a clone, a commit or git."""
        path_options = ("--git-path", "objects", "--git-path", "shallow", "--git-path", "info/exclude")
        arguments = ("rev-parse", "--show-toplevel", *path_options, "--show-object-format", "HEAD")
        output = _git_output(folder, *_CAUTIOUS_OPTIONS, *arguments)
        parts = [] if output is None else os.fsdecode(output).splitlines()
        # fewer parts without a commit, more if a path contains a line break
        if len(parts) != 6 or not folder.resolve().is_relative_to(parts[0]):
            return None
        root, objects, shallow, excluded, hash_name, commit = parts
        return cls(
            root=Path(root),
            commit=commit,
            hash_name=hash_name,
            _objects_folder=(folder / objects).resolve(),
            _shallow_file=(folder / shallow).resolve(),
            _exclude_file_bytes=_read_exclude_file(folder / excluded),
        )

    def differs_from_commit(self, folder: Path, leave_out: str | None = None) -> bool | None:
        """Return whether a folder in the clone differs from its commit; None if it is not in the commit.

        It differs if a file's bytes do, if a file is missing, or if there is another one that the clone's
        `.gitignore` or the user's own exclude file does not name. `leave_out` is a subfolder to leave out.
        Permissions and submodules are not compared. More than a GiB of files counts as a difference.
        """
        committed = self._committed_files(self._name_in_clone(folder))
        if not committed:
            return None
        if leave_out is not None:
            committed = {
                name: file for name, file in committed.items() if not name.startswith(f"{leave_out}/")
            }
        try:
            uncommitted = self._uncommitted_names(folder, committed, leave_out)
            return uncommitted is None or self._has_unignored_file(folder, uncommitted)
        except (OSError, MutatorError):  # what cannot be read is not as in the commit
            return True

    def find_changed(self, paths: Iterable[Path]) -> Path | None:
        """Return the first of these files that is not as in the commit; None if all are."""
        for path in paths:
            resolved = path.resolve()
            committed = self._committed_files(self._name_in_clone(resolved.parent), resolved.name).get(
                resolved.name
            )
            try:
                if committed is None or not self._is_as_committed(resolved, committed, _MOST_COMPARED_BYTES):
                    return resolved
            except (OSError, MutatorError):
                return resolved
        return None

    def describe_last_change(self, paths: Iterable[Path], log_format: str) -> str | None:
        """Describe the last commit, merges aside, that changed one of these files, in `git log`'s format."""
        names = [self._name_in_clone(path.resolve()) for path in paths]
        arguments = ("log", "-1", "--no-merges", "--no-show-signature", log_format, self.commit)
        output = self._run_on_objects(self.root, "--literal-pathspecs", *arguments, "--", *names)
        return None if output is None else output.decode("utf-8", "replace")

    def _name_in_clone(self, path: Path) -> str:
        return path.resolve().relative_to(self.root).as_posix()

    def _committed_files(self, prefix: str, *names: str) -> dict[str, _CommittedFile]:
        """Return the files of a folder in the commit; empty if the commit has none."""
        tree = self.commit if prefix == "." else f"{self.commit}:{prefix}"
        output = self._run_on_objects(
            self.root, "ls-tree", "-r", "-l", "-z", tree, *(("--", *names) if names else ())
        )
        file_by_name = {}
        for line in (output or b"").split(b"\0")[:-1]:
            facts, _, name = line.partition(b"\t")
            mode, _, blob, size = facts.decode().split()
            file_by_name[os.fsdecode(name)] = _CommittedFile(
                int(mode, 8), blob, None if size == "-" else int(size)
            )
        return file_by_name

    def _uncommitted_names(
        self, folder: Path, committed: Mapping[str, _CommittedFile], leave_out: str | None
    ) -> list[str] | None:
        """List what is not in the commit; None if a committed file is missing or differs.

        The name of a folder ends in a slash. Folders that hold committed files are not listed.
        """
        folders = {name[: place + 1] for name in committed for place, c in enumerate(name) if c == "/"}
        missing, remaining_bytes, uncommitted, pending_folders = (
            set(committed),
            _MOST_COMPARED_BYTES,
            list[str](),
            [""],
        )
        while pending_folders:
            for name, entry in _folder_entries(folder, pending_folders.pop()):
                if name == leave_out:
                    continue
                if name in committed:
                    missing.discard(name)
                    if not self._is_as_committed(Path(entry.path), committed[name], remaining_bytes):
                        return None
                    remaining_bytes -= committed[name].size or 0
                elif f"{name}/" in folders and entry.is_dir(follow_symlinks=False):
                    pending_folders.append(f"{name}/")
                else:
                    uncommitted += _names_for_git(name, entry)
        return None if missing else uncommitted

    def _is_as_committed(self, path: Path, committed: _CommittedFile, remaining_bytes: int) -> bool:
        state = path.lstat()
        if committed.mode == _SUBMODULE_MODE:
            return stat.S_ISDIR(state.st_mode)
        if (stat.S_IFMT(committed.mode), committed.size) != (stat.S_IFMT(state.st_mode), state.st_size):
            return False
        if state.st_size > remaining_bytes:
            return False
        hashed = hashlib.new(self.hash_name, b"blob %d\0" % state.st_size, usedforsecurity=False)
        if committed.mode == _LINK_MODE:
            hashed.update(os.fsencode(path.readlink()))
        else:
            with open_below(path.parent, path.name) as file:
                for block in iter(partial(file.read, _BLOCK_BYTES), b""):
                    hashed.update(block)
        return hashed.hexdigest() == committed.blob

    def _has_unignored_file(self, folder: Path, names: list[str]) -> bool:
        """Return whether there is a file among these names and in these folders that is not ignored."""
        while names:
            names_for_git = b"".join(os.fsencode(f"./{name}") + b"\0" for name in names)
            output = self._run_on_objects(
                folder, "check-ignore", "--no-index", "-z", "--stdin", input_bytes=names_for_git
            )
            ignored = {os.fsdecode(name).removeprefix("./") for name in (output or b"").split(b"\0")}
            unignored = [name for name in names if name not in ignored]
            if not all(name.endswith("/") for name in unignored):
                return True
            names = [
                git_name
                for name in unignored
                for entry in _folder_entries(folder, name)
                for git_name in _names_for_git(*entry)
            ]
        return False

    def _run_on_objects(self, folder: Path, *arguments: str, input_bytes: bytes = b"") -> bytes | None:
        """Ask an empty repository that has the clone's objects; nothing in the clone configures it."""
        with TemporaryDirectory(prefix="mutator-git-") as git_folder:
            for name in ("refs", "info"):
                Path(git_folder, name).mkdir()
            Path(git_folder, "HEAD").write_text(f"{self.commit}\n")
            Path(git_folder, "info/exclude").write_bytes(self._exclude_file_bytes)
            format_lines = f"1\n[extensions]\n\tobjectFormat = {self.hash_name}\n"
            Path(git_folder, "config").write_text(
                f"[core]\n\tbare = false\n\trepositoryFormatVersion = {format_lines}"
            )
            variables = {
                "GIT_DIR": git_folder,
                "GIT_WORK_TREE": str(self.root),
                "GIT_SHALLOW_FILE": str(self._shallow_file),
            }
            variables["GIT_OBJECT_DIRECTORY"] = str(self._objects_folder)
            return _git_output(folder, *arguments, variables=variables, input_bytes=input_bytes)


def find_clone_state(folder: Path) -> GitCloneState | None:
    """Return the git commit of a folder, and whether the folder has changed since; None if unknown."""
    clone = GitClone.find(folder)
    changed = None if clone is None else clone.differs_from_commit(folder)
    return None if clone is None or changed is None else GitCloneState(commit=clone.commit, changed=changed)


def find_user_name(folder: Path) -> str | None:
    """Return `user.name` of the user's own git configuration. The clone that `folder` is in cannot set it."""
    output = _git_output(folder, *_CAUTIOUS_OPTIONS, "config", "-z", "--show-scope", "--get-all", "user.name")
    parts = (output or b"").decode("utf-8", "replace").split("\0")[:-1]
    names = [
        name for scope, name in zip(parts[::2], parts[1::2], strict=False) if scope in _USER_CONFIG_SCOPES
    ]
    return (names[-1].strip() or None) if names else None


def _folder_entries(folder: Path, within: str) -> Iterator[tuple[str, "os.DirEntry[str]"]]:
    """Yield the entries of a subfolder (empty, or a name that ends in a slash) with their names."""
    with os.scandir(folder / within) as entries:
        for entry in entries:
            if entry.name != ".git":
                yield within + entry.name, entry


def _names_for_git(name: str, entry: "os.DirEntry[str]") -> list[str]:
    """Return the name as git writes it; none for what git does not store, such as a pipe."""
    if entry.is_dir(follow_symlinks=False):
        return [f"{name}/"]
    return [name] if entry.is_symlink() or entry.is_file(follow_symlinks=False) else []


def _read_exclude_file(path: Path) -> bytes:
    with suppress(OSError, MutatorError), open_below(path.parent, path.name) as file:
        return file.read(_MOST_EXCLUDE_FILE_BYTES)
    return b""


def _git_output(
    folder: Path, *arguments: str, variables: Mapping[str, str] | None = None, input_bytes: bytes = b""
) -> bytes | None:
    """Return the output of a git command in a folder; None if it fails, takes too long or writes too much.

    Of the user's variables for git, it gets none. It cannot connect to anything.
    """
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    # no fetch of missing objects, and no write to the clone, such as a refreshed index
    restrictions = {"GIT_ALLOW_PROTOCOL": "none", "GIT_NO_LAZY_FETCH": "1", "GIT_OPTIONAL_LOCKS": "0"}
    with TemporaryFile() as input_file:  # a pipe could fill up while git waits for its output to be read
        input_file.write(input_bytes)
        input_file.seek(0)
        try:
            process = subprocess.Popen(
                ["git", "--no-pager", "--no-replace-objects", "-C", str(folder), *arguments],
                env={**inherited, **restrictions, **(variables or {})},
                stdin=input_file,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        except OSError:
            return None
    assert process.stdout is not None
    timer = threading.Timer(_MOST_GIT_TIME_S, process.kill)
    timer.start()
    with process:
        try:
            output = process.stdout.read(_MOST_OUTPUT_BYTES)
            if process.stdout.read(1):  # a cut answer could look complete
                process.kill()
        except BaseException:
            process.kill()
            raise
        finally:
            timer.cancel()
    return output if process.returncode == 0 else None
