"""A sandbox for the processes that run a target's code: bubblewrap (`bwrap`), for the code of strangers.

In it, a process sees only its own processes, network and shared memory. Of the disk, it sees the system,
Python with its packages, and what a run reads. It can write to one folder only, which also holds its /tmp
and /dev/shm. What it computes is the same.
"""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

from mutator._common.files import remove_anything_at
from mutator.engines.process_endings import environment_variables_of_run
from mutator.errors import MutatorError
from mutator.targets.manifest import TargetManifest

_HARNESS_FOLDER = Path(__file__).parents[1]  # the harness, parts of which run inside
_ISOLATION_FLAGS = ("--unshare-all", "--die-with-parent", "--new-session", "--as-pid-1", "--cap-drop", "ALL")
# where systems keep programs and libraries; the last two: NixOS and Guix
_SYSTEM_FOLDERS = ("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/libx32", "/nix/store", "/gnu/store")
# to find libraries, fonts, users and the time; nothing of the network, and no secrets
_ETC_NAMES = ("alternatives", "fonts", "group", "ld.so.cache", "ld.so.conf", "ld.so.conf.d", "localtime")
_MORE_ETC_NAMES = ("mime.types", "nsswitch.conf", "passwd", "timezone")
_CPUS_FOLDER = "/sys/devices/system/cpu"  # libraries count the cores there
_PRINT_PYTHON_FOLDERS = (
    "import json, sys; print(json.dumps([sys.prefix, sys.base_prefix, sys.exec_prefix, *sys.path]))"
)
_TRIAL_TIMEOUT_S = 60.0  # to import numpy in a sandbox
_TEMPORARY_FOLDERS = {"/tmp": "tmp", "/dev/shm": "shm"}  # folders of the sandbox -> their names in its folder


class Sandbox:
    """A sandbox in which processes read `readable_paths`, and write to the folder `folder` and to `cache`."""

    def __init__(self, folder: Path, readable_paths: Iterable[Path], cache: Path | None = None) -> None:
        if folder.is_symlink():
            raise MutatorError(
                "a link in the place of a run's folder",
                where=folder,
                expected="the folder that the harness made",
                remedy="run the same command again; a mutant may have exchanged it",
            )
        self._folder = folder
        binds: list[str] = []
        self._temporary_handles: list[int] = []  # descriptors, because runs can exchange what is in `folder`
        for place, name in _TEMPORARY_FOLDERS.items():
            (folder / name).mkdir(exist_ok=True)
            self._temporary_handles.append(
                os.open(folder / name, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            )
            binds += ["--bind", str(folder / name), place]
        self._first_paths: set[Path] = set()
        system = [word for path in _system_paths() for word in _read_only_arguments(path)]
        devices = ("--proc", "/proc", "--dev", "/dev")
        readable = [
            word for path in (*_python_paths(), *readable_paths) for word in _read_only_arguments(path)
        ]
        writable = [word for path in (folder, *([cache] if cache else [])) for word in _bind_arguments(path)]
        sealed = ("--remount-ro", "/dev", "--remount-ro", "/", "--")
        self._command_prefix = [
            _bwrap_path(),
            *_ISOLATION_FLAGS,
            *system,
            *devices,
            *binds,
            *readable,
            *writable,
            *sealed,
        ]

    @classmethod
    def of_target(
        cls,
        manifest: TargetManifest,
        folder: Path,
        readable_paths: Iterable[Path],
        *,
        fault_free: bool = False,
    ) -> "Sandbox | None":
        """Return the sandbox of a run in `folder`, or None if the target's code runs without one.

        Besides `readable_paths`, a run reads what the target's arguments name: its root and its cache. Only
        `fault_free` runs write to the cache.
        """
        if not manifest.sandbox:
            return None
        if fault_free:
            with suppress(OSError):
                manifest.cache_folder.mkdir(parents=True, exist_ok=True)
                return cls(folder, (*readable_paths, *manifest.paths_read_by_runs()), manifest.cache_folder)
        return cls(folder, (*readable_paths, *manifest.paths_read_by_runs(), manifest.cache_folder))

    def wrap_command(self, words: Sequence[str]) -> list[str]:
        """Return the command that runs `words` in the sandbox."""
        return [*self._command_prefix, *words]

    def note_initial_temporary_paths(self) -> None:
        """Note what /tmp and /dev/shm contain before the first run. Folders can be mounted there."""
        self._first_paths = set(self._paths_in_temporary_folders())

    def delete_new_temporary_paths(self) -> None:
        """Delete what a run left in /tmp and /dev/shm."""
        for path in set(self._paths_in_temporary_folders()) - self._first_paths:
            remove_anything_at(path)

    def close(self) -> None:
        while self._temporary_handles:
            os.close(self._temporary_handles.pop())

    def _paths_in_temporary_folders(self) -> Iterator[Path]:
        for handle in self._temporary_handles:
            with suppress(OSError):
                yield from Path(f"/proc/self/fd/{handle}").iterdir()


def check_sandbox_available() -> None:
    """Raise MutatorError if no sandbox can be made here."""
    if problem := reason_sandbox_unavailable():
        raise MutatorError(
            f"no sandbox: {problem}",
            argument="sandbox",
            expected="bubblewrap, and a kernel on which users can make namespaces",
            remedy="see docs/explanation/trust.md#the-sandbox, or leave out `sandbox`",
        )


@lru_cache(maxsize=1)
def reason_sandbox_unavailable() -> str:
    """Return why no sandbox can be made here; empty if one can."""
    if shutil.which("bwrap") is None:
        return "`bwrap` is not installed (Debian, Ubuntu, Fedora: package bubblewrap)"
    with TemporaryDirectory(prefix="mutator-") as folder:
        try:
            trial = Sandbox(Path(folder), ())
            command = trial.wrap_command([sys.executable, "-P", "-s", "-c", "import numpy"])
            trial.close()
            trial_run = subprocess.run(
                command,
                cwd=folder,
                env=environment_variables_of_run(0, Path(folder)),
                capture_output=True,
                text=True,
                timeout=_TRIAL_TIMEOUT_S,
                check=False,
            )
        except (OSError, subprocess.TimeoutExpired) as err:
            return str(err)
    messages = trial_run.stderr.strip().splitlines() or [f"`bwrap` ended with status {trial_run.returncode}"]
    return messages[-1] if trial_run.returncode else ""


def _bwrap_path() -> str:
    return shutil.which("bwrap") or "bwrap"


def _bind_arguments(path: Path) -> tuple[str, str, str]:
    return ("--bind", str(path), str(path))


def _read_only_arguments(path: str | Path) -> tuple[str, str, str]:
    return ("--ro-bind-try", str(path), str(path))


def _system_paths() -> Iterator[str]:
    yield from _SYSTEM_FOLDERS
    yield from (f"/etc/{name}" for name in (*_ETC_NAMES, *_MORE_ETC_NAMES))
    yield _CPUS_FOLDER


@lru_cache(maxsize=1)
def _python_paths() -> tuple[Path, ...]:
    """Return the folders and files of Python, its packages, their libraries, and the harness.

    A folder that contains the user's home is left out, because the sandbox hides the home.
    """
    with TemporaryDirectory(prefix="mutator-") as folder:
        printed = subprocess.run(
            [sys.executable, "-P", "-s", "-c", _PRINT_PYTHON_FOLDERS],
            cwd=folder,
            env=environment_variables_of_run(0, Path(folder)),
            capture_output=True,
            check=True,
        )
    libraries = os.environ.get("LD_LIBRARY_PATH", "").split(os.pathsep)
    named = [_HARNESS_FOLDER, *map(Path, (*json.loads(printed.stdout), *libraries))]
    candidates = {place for path in named for place in (path, path.resolve()) if path.is_absolute()}
    home = Path(os.environ.get("HOME") or "/").resolve()
    readable = {path for path in candidates if path.exists() and not home.is_relative_to(path.resolve())}
    return tuple(sorted(path for path in readable if not readable & set(path.parents)))
