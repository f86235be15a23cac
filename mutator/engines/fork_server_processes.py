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
from mutator._common.file_change_detection import FileChangeDetector
from mutator._common.files import remove_folder
from mutator.engines import pyc_files
from mutator.engines.engine_jobs import MOST_WAITING_PROCESSES
from mutator.engines.job_tree import JobTree
from mutator.engines.process_endings import environment_variables_of_run, exception_in_report, wait_for_guard
from mutator.engines.sandbox import Sandbox
from mutator.engines.thread_messages import describe_too_many_threads, remedy_for_threads
from mutator.errors import ForkServerLost, NotForkable
from mutator.targets.manifest import TargetManifest

_SERVER_SCRIPT = Path(__file__).parent / "in_target" / "fork_server.py"
_LOAD_REMEDY = "run `mutator check --drive`: if the golden run fails, too, no campaign can start"
# steps; a process at most this far behind is advanced, not copied: it is quickly remade
_MOST_STEPS_TO_ADVANCE = 100
_MOST_HANDLES = 2  # in a reply
_PARENT_CHECK_INTERVAL_S = 0.5  # interval between two checks that the parent is alive
_START_TIMEOUT_S = 120.0  # to load the target, whose libraries a busy machine imports slowly


@dataclass(frozen=True, slots=True, kw_only=True)
class GoldenRunRequest:
    key: Hashable
    scenario: Path
    arguments: Callable[[], list[str]]


class WaitingProcess:
    """A waiting process of the server.

    The first waits before any run (`key` None). Others wait before `step` of the golden run `key`.
    """

    def __init__(
        self,
        connection: socket.socket,
        parent_pid: int | None,
        wake_processes: Callable[[], None],
        key: Hashable = None,
    ) -> None:
        self.key = key
        self.step = 0
        self.loaded_modules: set[str] = set()  # modules loaded for mutants
        self.last_used_s = 0.0
        self._connection = connection
        self._parent_pid = parent_pid
        self._wake_processes = wake_processes
        connection.settimeout(_PARENT_CHECK_INTERVAL_S)

    def send_request(self, request: dict[str, Any], patience_s: float) -> tuple[dict[str, Any], list[int]]:
        data = marshal.dumps(request)
        self._connection.settimeout(patience_s)
        try:
            self._connection.sendall(struct.pack("<I", len(data)) + data)
        except OSError as err:
            raise ForkServerLost(f"a process of the fork server is gone ({err})") from None
        return self.receive_reply(patience_s)

    def receive_reply(self, patience_s: float) -> tuple[dict[str, Any], list[int]]:
        self._connection.settimeout(_PARENT_CHECK_INTERVAL_S)
        deadline = time.monotonic() + patience_s
        handles: list[int] = []
        head = self._receive_bytes(4, deadline, handles)
        reply: dict[str, Any] = marshal.loads(
            self._receive_bytes(struct.unpack("<I", head)[0], deadline, handles)
        )
        return reply, handles

    def load_modules(self, modules: Sequence[str], patience_s: float) -> None:
        """Import modules now, so that each fork finds them loaded."""
        if new := [name for name in modules if name not in self.loaded_modules]:
            self.send_request({"do": "load", "modules": new}, patience_s)
            self.loaded_modules.update(new)

    def close(self) -> None:
        self._connection.close()

    def _receive_bytes(self, byte_count: int, deadline: float, handles: list[int]) -> bytes:
        data = b""
        while len(data) < byte_count:
            try:
                part, new_handles, _, _ = socket.recv_fds(
                    self._connection, byte_count - len(data), _MOST_HANDLES
                )
            except TimeoutError:
                self._wake_processes()
                if self._parent_pid is not None and os.getppid() != self._parent_pid:
                    raise SystemExit("the process that started this one is gone") from None
                if time.monotonic() > deadline:
                    raise ForkServerLost("the fork server does not answer") from None
                continue
            except OSError as err:
                raise ForkServerLost(f"a process of the fork server is gone ({err})") from None
            handles += new_handles
            if not part:
                raise ForkServerLost("a process of the fork server is gone")
            data += part
        return data


@contextmanager
def raising_if_server_input_changes(path: Path) -> Iterator[None]:
    """Raise ForkServerLost if a file is written to while the server uses it."""
    used = FileChangeDetector({str(path.resolve()): read_bounded(path)})
    yield
    if used.first_changed_path():
        raise ForkServerLost(f"{path.name} was changed while it was in use")


class ForkServer:
    """A fork server with its waiting processes, in the new folder `scratch_folder`.

    In a sandbox, they can read `scenarios_folder`, and write to the folder in which `scratch_folder` is.
    `shared_parts` are those of `fork_messages.SharedParts`. At most `most_waiting_processes` (two or more)
    wait; of more, the one that was used longest ago ends.

    Its tree has no bytecode, which a mutant could exchange before the server loads one more module. Raises
    NotForkable if the target cannot be loaded or has more than one thread, and ForkServerLost if the server
    ends without an answer, or if its tree is not the pristine one.
    """

    def __init__(
        self,
        manifest: TargetManifest,
        scratch_folder: Path,
        parent_pid: int | None,
        scenarios_folder: Path,
        shared_parts: Sequence[Any] = (),
        *,
        most_waiting_processes: int = MOST_WAITING_PROCESSES,
    ) -> None:
        assert manifest.stepwise_function is not None
        self.scratch_folder = scratch_folder
        self.scenarios_folder = scenarios_folder
        self.tree_folder = tree_folder_of_server(scratch_folder)
        self._parent_pid = parent_pid
        self._waiting_processes: list[WaitingProcess] = []
        self._most_waiting_processes = most_waiting_processes
        self._process_group = 0  # the server's process group, once known
        pyc_files.write_files(manifest.tree.files, self.tree_folder)
        self._tree = JobTree(self.tree_folder, manifest.tree.files, {})
        start = {
            "tree": str(self.tree_folder),
            "home": str(scratch_folder),
            "packages": list(manifest.import_names),
            "module": manifest.entry_module,
            "stepwise": manifest.stepwise_function,
            "shared": list(shared_parts),
        }
        start_path, data = scratch_folder / "start.marshal", marshal.dumps(start)
        start_path.write_bytes(data)
        self._start_file = FileChangeDetector({str(start_path): data})
        harness_socket, server_socket = socket.socketpair()
        command = [
            sys.executable,
            "-P",
            "-s",
            str(_SERVER_SCRIPT),
            str(server_socket.fileno()),
            str(start_path),
        ]
        self._sandbox = Sandbox.of_target(manifest, scratch_folder.parent, [scenarios_folder])
        if self._sandbox:
            command = self._sandbox.wrap_command(command)
        with server_socket, (scratch_folder / "log").open("wb") as log:
            self._process = subprocess.Popen(
                command,
                cwd=scratch_folder,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env=environment_variables_of_run(0, scratch_folder, manifest.env),
                pass_fds=[server_socket.fileno()],
                start_new_session=True,
            )
        self.first_process = WaitingProcess(harness_socket, parent_pid, self._continue_stopped_processes)
        try:
            self._receive_welcome()
        except BaseException:
            self.close()
            raise

    def _receive_welcome(self) -> None:
        welcome, _ = self.first_process.receive_reply(_START_TIMEOUT_S)
        if "failed" in welcome:
            raise NotForkable(f"it cannot be loaded: {_describe_failure(welcome['failed'])}", _LOAD_REMEDY)
        if welcome["threads"]:
            others = welcome["threads"]
            raise NotForkable(
                f"once it is loaded, {describe_too_many_threads(others)}", remedy_for_threads(others)
            )
        self._process_group = welcome["group"]
        if self._tree.first_changed_path() or self._start_file.first_changed_path():
            raise ForkServerLost("the tree of the fork server is not the pristine one")
        if self._sandbox:
            self._sandbox.note_initial_temporary_paths()

    def clear_sandbox_temporary_folders(self) -> None:
        """Delete what a run has left in the temporary folders of the sandbox."""
        if self._sandbox:
            self._sandbox.delete_new_temporary_paths()

    def process_before_step(
        self, step: int, golden: GoldenRunRequest, modules: Sequence[str], patience_s: float
    ) -> WaitingProcess:
        """Return a process that waits before `step` of the golden run, with these modules loaded."""
        if self._process.poll() is not None:
            raise ForkServerLost("the fork server is gone")
        mine = [w for w in self._waiting_processes if w.key == golden.key and w.step <= step]
        if not mine:
            self.first_process.load_modules(modules, patience_s)
            with raising_if_server_input_changes(golden.scenario):
                mine = [
                    self._branch_process(self.first_process, golden.key, 0, patience_s, golden.arguments())
                ]
        best = max(mine, key=lambda waiting: waiting.step)
        best.load_modules(modules, patience_s)
        if 0 < best.step < step <= best.step + _MOST_STEPS_TO_ADVANCE:
            reply, _ = best.send_request({"do": "advance", "step": step}, patience_s)
            best.step = reply["step"]
        elif best.step < step:
            best = self._branch_process(best, golden.key, step, patience_s)
        best.last_used_s = time.monotonic()
        return best

    def _branch_process(
        self,
        source: WaitingProcess,
        key: Hashable,
        step: int,
        patience_s: float,
        arguments: list[str] | None = None,
    ) -> WaitingProcess:
        source.last_used_s = time.monotonic()
        while len(self._waiting_processes) >= self._most_waiting_processes:
            oldest = min(
                (w for w in self._waiting_processes if w is not source),
                key=lambda waiting: waiting.last_used_s,
            )
            self._waiting_processes.remove(oldest)
            oldest.close()
        branch_reply, handles = source.send_request(
            {"do": "branch", "step": step, "args": arguments}, patience_s
        )
        if branch_reply["threads"] or len(handles) != 1:
            raise NotForkable(
                describe_too_many_threads(branch_reply["threads"]),
                remedy_for_threads(branch_reply["threads"]),
            )
        branched = WaitingProcess(
            socket.socket(fileno=handles[0]), self._parent_pid, self._continue_stopped_processes, key
        )
        branched.loaded_modules |= source.loaded_modules
        reply, _ = branched.receive_reply(patience_s)
        if "failed" in reply:
            branched.close()
            raise NotForkable(
                f"its golden run cannot be driven step by step: {_describe_failure(reply['failed'])}"
            )
        branched.step = reply["step"]
        self._waiting_processes.append(branched)
        return branched

    def _continue_stopped_processes(self) -> None:
        """Continue the server's processes, which a mutant can stop. Mutants have other process groups."""
        self._process.send_signal(signal.SIGCONT)
        if self._process_group:
            with suppress(ProcessLookupError):
                os.killpg(self._process_group, signal.SIGCONT)

    def close(self) -> None:
        for waiting in (self.first_process, *self._waiting_processes):
            waiting.close()
        wait_for_guard(self._process)
        if self._sandbox:
            self._sandbox.close()
        remove_folder(self.scratch_folder)


def tree_folder_of_server(scratch_folder: Path) -> Path:
    return scratch_folder / "tree"


def _describe_failure(failure: dict[str, Any]) -> str:
    raised = exception_in_report(failure)
    return raised.description if raised else ""
