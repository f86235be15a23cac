"""The harness's side of a fork server: golden runs that wait between steps to be forked.

The target's side is fork_server.py.
"""

import marshal
import os
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mutator._common.bounded_reading import read_bounded
from mutator._common.file_change_detection import UnchangedFiles
from mutator._common.files import remove_folder
from mutator.engines import bytecode
from mutator.engines.job_tree import RunTree
from mutator.engines.sandbox import Sandbox
from mutator.engines.target_processes import end, environment, raised_in
from mutator.engines.thread_messages import too_many, turned_off
from mutator.errors import ForkServerLost, NotForkable
from mutator.targets.manifest import TargetManifest

_SERVER = Path(__file__).parent / "in_target" / "fork_server.py"
_MOST = 8  # maximum number of waiting processes, because each takes about 20 MB
_NEAR = 100  # steps; a process at most this far behind is advanced, not copied: it is quickly remade
_LOOK_UP_S = 0.5  # interval between two checks that the parent is alive
_START_S = 120.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Golden:
    key: Hashable
    scenario: Path
    arguments: Callable[[], list[str]]


class Waiting:
    """A waiting process of the server.

    The first waits before any run (`key` None). Others wait before `step` of the golden run `key`.
    """

    def __init__(
        self,
        connection: socket.socket,
        parent: int | None,
        wake: Callable[[], None],
        key: Hashable = None,
    ) -> None:
        self.key = key
        self.step = 0
        self.loaded: set[str] = set()  # modules loaded for mutants
        self.used = 0.0
        self._connection = connection
        self._parent = parent
        self._wake = wake
        connection.settimeout(_LOOK_UP_S)

    def ask(self, request: dict[str, Any], patience_s: float) -> tuple[dict[str, Any], list[int]]:
        data = marshal.dumps(request)
        self._connection.settimeout(patience_s)
        try:
            self._connection.sendall(struct.pack("<I", len(data)) + data)
        except OSError as err:
            raise ForkServerLost(f"a process of the fork server is gone ({err})") from None
        return self.reply(patience_s)

    def reply(self, patience_s: float) -> tuple[dict[str, Any], list[int]]:
        self._connection.settimeout(_LOOK_UP_S)
        deadline = time.monotonic() + patience_s
        handles: list[int] = []
        head = self._read(4, deadline, handles)
        reply: dict[str, Any] = marshal.loads(self._read(struct.unpack("<I", head)[0], deadline, handles))
        return reply, handles

    def load(self, modules: Sequence[str], patience_s: float) -> None:
        """Import modules now, so that each fork finds them loaded."""
        if new := [name for name in modules if name not in self.loaded]:
            self.ask({"do": "load", "modules": new}, patience_s)
            self.loaded.update(new)

    def close(self) -> None:
        self._connection.close()

    def _read(self, count: int, deadline: float, handles: list[int]) -> bytes:
        data = b""
        while len(data) < count:
            try:
                part, found, _, _ = socket.recv_fds(self._connection, count - len(data), 1)
            except TimeoutError:
                self._wake()
                if self._parent is not None and os.getppid() != self._parent:
                    raise SystemExit("the process that started this one is gone") from None
                if time.monotonic() > deadline:
                    raise ForkServerLost("the fork server does not answer") from None
                continue
            except OSError as err:
                raise ForkServerLost(f"a process of the fork server is gone ({err})") from None
            handles += found
            if not part:
                raise ForkServerLost("a process of the fork server is gone")
            data += part
        return data


@contextmanager
def used_unchanged(path: Path) -> Iterator[None]:
    """Raise ForkServerLost if a file is written to while the server uses it."""
    used = UnchangedFiles({str(path.resolve()): read_bounded(path)})
    yield
    if used.first_changed():
        raise ForkServerLost(f"{path.name} was changed while it was in use")


class Pool:
    """A fork server with its waiting processes, in the new scratch folder `home`.

    In a sandbox, they can read the folder `scenarios`, and write to the folder in which `home` is.

    Its tree has no bytecode, which a mutant could exchange before the server loads one more module. Raises
    NotForkable if the target cannot be loaded or has more than one thread, and ForkServerLost if the server
    ends without an answer, or if its tree is not the pristine one.
    """

    def __init__(self, manifest: TargetManifest, home: Path, parent: int | None, scenarios: Path) -> None:
        assert manifest.stepwise is not None
        self.home = home
        self.scenarios = scenarios
        self.tree = home / "tree"
        self._parent = parent
        self._waiting: list[Waiting] = []
        self._group = 0  # the server's process group, once known
        bytecode.write(manifest.tree.files, self.tree)
        self._files = RunTree(self.tree, manifest.tree.files, {})
        start = {
            "tree": str(self.tree),
            "home": str(home),
            "packages": list(manifest.import_names),
            "module": manifest.entry_module,
            "stepwise": manifest.stepwise,
        }
        told, data = home / "start.marshal", marshal.dumps(start)
        told.write_bytes(data)
        self._told = UnchangedFiles({str(told): data})
        ours, theirs = socket.socketpair()
        command = [sys.executable, "-P", "-s", str(_SERVER), str(theirs.fileno()), str(told)]
        self._sandbox = Sandbox.of(manifest, home.parent, [scenarios])
        if self._sandbox:
            command = self._sandbox.command(command)
        with theirs, (home / "log").open("wb") as log:
            self._process = subprocess.Popen(
                command,
                cwd=home,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env=environment(0, home, manifest.env),
                pass_fds=[theirs.fileno()],
                start_new_session=True,
            )
        self.first = Waiting(ours, parent, self._wake)
        try:
            self._welcome()
        except BaseException:
            self.close()
            raise

    def _welcome(self) -> None:
        said, _ = self.first.reply(_START_S)
        if "failed" in said:
            raise NotForkable(f"it cannot be loaded: {_why(said['failed'])}")
        if said["threads"]:
            others = said["threads"]
            raise NotForkable(f"once it is loaded, {too_many(others)}", turned_off(others))
        self._group = said["group"]
        if self._files.first_changed() or self._told.first_changed():
            raise ForkServerLost("the tree of the fork server is not the pristine one")
        if self._sandbox:
            self._sandbox.begin()

    def clean(self) -> None:
        """Delete what a run has left in the temporary folders of the sandbox."""
        if self._sandbox:
            self._sandbox.clear()

    def before(self, step: int, golden: Golden, modules: Sequence[str], patience_s: float) -> Waiting:
        """Return a process that waits before `step` of the golden run, with these modules loaded."""
        if self._process.poll() is not None:
            raise ForkServerLost("the fork server is gone")
        mine = [w for w in self._waiting if w.key == golden.key and w.step <= step]
        if not mine:
            self.first.load(modules, patience_s)
            with used_unchanged(golden.scenario):
                mine = [self._branch(self.first, golden.key, 0, patience_s, golden.arguments())]
        best = max(mine, key=lambda waiting: waiting.step)
        best.load(modules, patience_s)
        if 0 < best.step < step <= best.step + _NEAR:
            reply, _ = best.ask({"do": "advance", "step": step}, patience_s)
            best.step = reply["step"]
        elif best.step < step:
            best = self._branch(best, golden.key, step, patience_s)
        best.used = time.monotonic()
        return best

    def _branch(
        self, source: Waiting, key: Hashable, step: int, patience_s: float, arguments: list[str] | None = None
    ) -> Waiting:
        source.used = time.monotonic()
        while len(self._waiting) >= _MOST:
            oldest = min((w for w in self._waiting if w is not source), key=lambda waiting: waiting.used)
            self._waiting.remove(oldest)
            oldest.close()
        said, handles = source.ask({"do": "branch", "step": step, "args": arguments}, patience_s)
        if said["threads"] or len(handles) != 1:
            raise NotForkable(too_many(said["threads"]), turned_off(said["threads"]))
        made = Waiting(socket.socket(fileno=handles[0]), self._parent, self._wake, key)
        made.loaded |= source.loaded
        reply, _ = made.reply(patience_s)
        if "failed" in reply:
            made.close()
            raise NotForkable(f"its golden run cannot be driven step by step: {_why(reply['failed'])}")
        made.step = reply["step"]
        self._waiting.append(made)
        return made

    def _wake(self) -> None:
        """Continue the server's processes, which a mutant can stop. Mutants have other process groups."""
        self._process.send_signal(signal.SIGCONT)
        if self._group:
            with suppress(ProcessLookupError):
                os.killpg(self._group, signal.SIGCONT)

    def close(self) -> None:
        for waiting in (self.first, *self._waiting):
            waiting.close()
        end(self._process)
        if self._sandbox:
            self._sandbox.close()
        remove_folder(self.home)


def _why(failed: dict[str, Any]) -> str:
    raised = raised_in(failed)
    return raised.text if raised else ""
