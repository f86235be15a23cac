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
from mutator.store.work_stretches import CloneState

_PATIENCE_S = 10.0  # for one answer
_MOST_SAID = 32 << 20  # bytes of an answer; a tiny repository can list billions of files
_MOST_EXCLUDED = 1 << 20  # bytes of an exclude file
_MOST_READ = 1 << 30  # bytes of files to compare
_BLOCK = 1 << 20  # bytes
_LINK, _SUBMODULE = 0o120000, 0o160000  # modes of git
_CAUTIOUS = ("-c", "safe.bareRepository=explicit", "-c", "core.fsmonitor=false")
_USERS_OWN = ("system", "global", "command")  # scopes of configuration that no clone can set


@dataclass(frozen=True, slots=True)
class _File:
    """A file in a commit: its mode, the hash of its content and, unless it is a submodule, its size."""

    mode: int
    blob: str
    size: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Clone:
    """A clone with a commit. `top` is its folder; `hash_name` is `sha1` or `sha256`."""

    top: Path
    commit: str
    hash_name: str
    _objects: Path
    _shallow: Path
    _excluded: bytes

    @classmethod
    def of(cls, folder: Path) -> "Clone | None":
        """Return the clone that a folder is in; None without a clone, a commit or git."""
        asked = ("--git-path", "objects", "--git-path", "shallow", "--git-path", "info/exclude")
        words = ("rev-parse", "--show-toplevel", *asked, "--show-object-format", "HEAD")
        said = _git(folder, *_CAUTIOUS, *words)
        parts = [] if said is None else os.fsdecode(said).splitlines()
        if len(parts) != 6 or not folder.resolve().is_relative_to(parts[0]):
            return None
        top, objects, shallow, excluded, hash_name, commit = parts
        return cls(
            top=Path(top),
            commit=commit,
            hash_name=hash_name,
            _objects=(folder / objects).resolve(),
            _shallow=(folder / shallow).resolve(),
            _excluded=_text_of(folder / excluded),
        )

    def differs(self, folder: Path, leave_out: str | None = None) -> bool | None:
        """Return whether a folder in the clone differs from its commit; None if it is not in the commit.

        It differs if a file's bytes do, if a file is missing, or if there is another one that the clone's
        `.gitignore` or the user's own exclude file does not name. `leave_out` is a subfolder to leave out.
        Permissions and submodules are not compared. More than a GiB of files counts as a difference.
        """
        found = self._files(self._name(folder))
        if not found:
            return None
        if leave_out is not None:
            found = {name: file for name, file in found.items() if not name.startswith(f"{leave_out}/")}
        try:
            strange = self._strange(folder, found, leave_out)
            return strange is None or self._any_not_ignored(folder, strange)
        except (OSError, MutatorError):  # what cannot be read is not as in the commit
            return True

    def changed(self, paths: Iterable[Path]) -> Path | None:
        """Return the first of these files that is not as in the commit; None if all are."""
        for path in paths:
            place = path.resolve()
            committed = self._files(self._name(place.parent), place.name).get(place.name)
            try:
                if committed is None or not self._is_same(place, committed, _MOST_READ):
                    return place
            except (OSError, MutatorError):
                return place
        return None

    def last_change(self, paths: Iterable[Path], form: str) -> str | None:
        """Describe the last commit, merges aside, that changed one of these files, in `git log`'s format."""
        names = [self._name(path.resolve()) for path in paths]
        words = ("log", "-1", "--no-merges", "--no-show-signature", form, self.commit)
        said = self._ask(self.top, "--literal-pathspecs", *words, "--", *names)
        return None if said is None else said.decode("utf-8", "replace")

    def _name(self, path: Path) -> str:
        return path.resolve().relative_to(self.top).as_posix()

    def _files(self, prefix: str, *names: str) -> dict[str, _File]:
        """Return the files of a folder in the commit; empty if the commit has none."""
        tree = self.commit if prefix == "." else f"{self.commit}:{prefix}"
        said = self._ask(self.top, "ls-tree", "-r", "-l", "-z", tree, *(("--", *names) if names else ()))
        found = {}
        for line in (said or b"").split(b"\0")[:-1]:
            facts, _, name = line.partition(b"\t")
            mode, _, blob, size = facts.decode().split()
            found[os.fsdecode(name)] = _File(int(mode, 8), blob, None if size == "-" else int(size))
        return found

    def _strange(
        self, folder: Path, committed: Mapping[str, _File], leave_out: str | None
    ) -> list[str] | None:
        """List what is not in the commit; None if a committed file is missing or differs.

        The name of a folder ends in a slash. Folders that hold committed files are not listed.
        """
        folders = {name[: place + 1] for name in committed for place, c in enumerate(name) if c == "/"}
        left, room, strange, todo = set(committed), _MOST_READ, list[str](), [""]
        while todo:
            for name, entry in _entries(folder, todo.pop()):
                if name == leave_out:
                    continue
                if name in committed:
                    left.discard(name)
                    if not self._is_same(Path(entry.path), committed[name], room):
                        return None
                    room -= committed[name].size or 0
                elif f"{name}/" in folders and entry.is_dir(follow_symlinks=False):
                    todo.append(f"{name}/")
                else:
                    strange += _listed(name, entry)
        return None if left else strange

    def _is_same(self, path: Path, committed: _File, room: int) -> bool:
        state = path.lstat()
        if committed.mode == _SUBMODULE:
            return stat.S_ISDIR(state.st_mode)
        if (stat.S_IFMT(committed.mode), committed.size) != (stat.S_IFMT(state.st_mode), state.st_size):
            return False
        if state.st_size > room:
            return False
        hashed = hashlib.new(self.hash_name, b"blob %d\0" % state.st_size, usedforsecurity=False)
        if committed.mode == _LINK:
            hashed.update(os.fsencode(path.readlink()))
        else:
            with open_below(path.parent, path.name) as file:
                for block in iter(partial(file.read, _BLOCK), b""):
                    hashed.update(block)
        return hashed.hexdigest() == committed.blob

    def _any_not_ignored(self, folder: Path, names: list[str]) -> bool:
        """Return whether there is a file among these names and in these folders that is not ignored."""
        while names:
            asked = b"".join(os.fsencode(f"./{name}") + b"\0" for name in names)
            said = self._ask(folder, "check-ignore", "--no-index", "-z", "--stdin", asked=asked)
            ignored = {os.fsdecode(name).removeprefix("./") for name in (said or b"").split(b"\0")}
            left = [name for name in names if name not in ignored]
            if not all(name.endswith("/") for name in left):
                return True
            names = [one for name in left for found in _entries(folder, name) for one in _listed(*found)]
        return False

    def _ask(self, folder: Path, *words: str, asked: bytes = b"") -> bytes | None:
        """Ask an empty repository that has the clone's objects; nothing in the clone configures it."""
        with TemporaryDirectory(prefix="mutator-git-") as own:
            for name in ("refs", "info"):
                Path(own, name).mkdir()
            Path(own, "HEAD").write_text(f"{self.commit}\n")
            Path(own, "info/exclude").write_bytes(self._excluded)
            form = f"1\n[extensions]\n\tobjectFormat = {self.hash_name}\n"
            Path(own, "config").write_text(f"[core]\n\tbare = false\n\trepositoryFormatVersion = {form}")
            places = {"GIT_DIR": own, "GIT_WORK_TREE": str(self.top), "GIT_SHALLOW_FILE": str(self._shallow)}
            places["GIT_OBJECT_DIRECTORY"] = str(self._objects)
            return _git(folder, *words, places=places, asked=asked)


def clone_state(folder: Path) -> CloneState | None:
    """Return the git commit of a folder, and whether the folder has changed since; None if unknown."""
    clone = Clone.of(folder)
    changed = None if clone is None else clone.differs(folder)
    return None if clone is None or changed is None else CloneState(commit=clone.commit, changed=changed)


def user_name(folder: Path) -> str | None:
    """Return `user.name` of the user's own git configuration. The clone that `folder` is in cannot set it."""
    said = _git(folder, *_CAUTIOUS, "config", "-z", "--show-scope", "--get-all", "user.name")
    parts = (said or b"").decode("utf-8", "replace").split("\0")[:-1]
    names = [name for scope, name in zip(parts[::2], parts[1::2], strict=False) if scope in _USERS_OWN]
    return (names[-1].strip() or None) if names else None


def _entries(folder: Path, within: str) -> Iterator[tuple[str, "os.DirEntry[str]"]]:
    """Yield the entries of a subfolder (empty, or a name that ends in a slash) with their names."""
    with os.scandir(folder / within) as entries:
        for entry in entries:
            if entry.name != ".git":
                yield within + entry.name, entry


def _listed(name: str, entry: "os.DirEntry[str]") -> list[str]:
    """Return the name as git writes it; none for what git does not store, such as a pipe."""
    if entry.is_dir(follow_symlinks=False):
        return [f"{name}/"]
    return [name] if entry.is_symlink() or entry.is_file(follow_symlinks=False) else []


def _text_of(path: Path) -> bytes:
    with suppress(OSError, MutatorError), open_below(path.parent, path.name) as file:
        return file.read(_MOST_EXCLUDED)
    return b""


def _git(
    folder: Path, *words: str, places: Mapping[str, str] | None = None, asked: bytes = b""
) -> bytes | None:
    """Return the output of a git command in a folder; None if it fails, takes too long or writes too much.

    Of the user's variables for git, it gets none. It cannot connect to anything.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    cautious = {"GIT_ALLOW_PROTOCOL": "none", "GIT_NO_LAZY_FETCH": "1", "GIT_OPTIONAL_LOCKS": "0"}
    with TemporaryFile() as question:
        question.write(asked)
        question.seek(0)
        try:
            process = subprocess.Popen(
                ["git", "--no-pager", "--no-replace-objects", "-C", str(folder), *words],
                env={**kept, **cautious, **(places or {})},
                stdin=question,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        except OSError:
            return None
    assert process.stdout is not None
    limit = threading.Timer(_PATIENCE_S, process.kill)
    limit.start()
    with process:
        try:
            said = process.stdout.read(_MOST_SAID)
            if process.stdout.read(1):
                process.kill()
        except BaseException:
            process.kill()
            raise
        finally:
            limit.cancel()
    return said if process.returncode == 0 else None
