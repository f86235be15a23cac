"""A loaded target that forks: `python -P -s fork_server.py SOCKET START.marshal`. Standard library only.

Each process waits between two steps of a golden run; the first waits before any run. A process answers on its
own socket with marshalled dicts, each preceded by its length. While it has only one thread, it forks on
request, to run a mutant or to wait at a later step. It ends when the other end closes its socket, or
when the first process ends (process_guard.py).
"""

import array
import atexit
import gc
import importlib
import importlib.util
import io
import marshal
import mmap
import operator
import os
import socket
import struct
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn

_spec = importlib.util.spec_from_file_location("run_once", Path(__file__).with_name("run_once.py"))
assert _spec and _spec.loader
run_once: Any = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(run_once)
process_guard = run_once.process_guard
mutant_installation, thread_names = (
    run_once.load_neighbour("mutant_installation"),
    run_once.load_neighbour("thread_names"),
)
early_stop = run_once.load_neighbour("early_stop")
function_recorder = run_once.load_neighbour("function_recorder")
fork_output = run_once.load_neighbour("fork_output")
crash_description = run_once.load_neighbour("crash_description")


def main(connection_fd: int, start_file: str) -> int:
    if process_guard.fork_guarded(connection_fd) is not None:
        return 0
    process_guard.restore_default_signals()
    try:
        serve_as_first_process(connection_fd, marshal.loads(Path(start_file).read_bytes()))
    finally:
        os._exit(0)  # skip exit handlers, which belong to the server, not to the target's runs


def serve_as_first_process(connection_fd: int, start_message: dict[str, Any]) -> None:
    os.chdir(start_message["home"])
    sys.path.insert(0, start_message["tree"])
    sys.meta_path.insert(0, run_once.HarnessImportFinder)
    sys.argv = [start_message["module"]]
    server = ForkingProcess(start_message, socket.socket(fileno=connection_fd))
    server.function_recorder.begin()
    try:
        module = importlib.import_module(start_message["module"])
        server.begin_run = operator.attrgetter(start_message["stepwise"])(module)
    except BaseException as err:
        server.send_reply({"failed": run_once.describe_failure(err, start_message["tree"], None)})
        return
    gc.collect()
    server.send_reply({"threads": thread_names.other_thread_names(), "group": os.getpgrp()})
    server.serve_requests()


_PID_LIMIT_FILE = Path("/proc/sys/kernel/pid_max")
# what real files derive from; an `isinstance` with the abstract class `io.IOBase` takes 20 times as long
_FILE_BASE: Any = io.IOBase.__mro__[1]


class NoLongerNeeded(Exception):
    """The process is no longer needed."""


class ForkingProcess:
    """A waiting process. `golden_run` is its golden run, stopped before `step`; None before any run."""

    def __init__(self, start_message: dict[str, Any], connection: socket.socket) -> None:
        self.start_message = start_message
        self.connection = connection
        self.tree_paths = run_once.list_tree_paths(start_message["tree"])
        self.first_tree_stamp = run_once.change_stamp(self.tree_paths)
        self.files_outside_tree: list[
            str
        ] = []  # files outside the tree from which the target's packages were imported
        self.begin_run: Any = None
        self.golden_run: Any = None
        # a byte for each process id, 1 for those that wait; shared, because this process adopts those that
        # one of its children forked, when that child ends
        self.is_waiting = mmap.mmap(-1, int(_PID_LIMIT_FILE.read_text()))
        self.loaded_files = mutant_installation.LoadedFiles()
        self.inherited_processes = 0  # processes that the run had started before this one was forked
        self.step = 0
        self.function_recorder = function_recorder.FunctionRecorder(start_message["tree"])

    def send_reply(self, reply: dict[str, Any], *handles: int) -> None:
        data = marshal.dumps(reply)
        more = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", handles))] if handles else []
        self.connection.sendmsg([struct.pack("<I", len(data))], more)
        self.connection.sendall(data)

    def serve_requests(self) -> None:
        methods_by_request: dict[str, Callable[..., dict[str, Any] | None]] = {
            "branch": self.fork_waiting_process,
            "advance": self.advance_to_step,
            "load": self.load_modules,
            "mutant": self.fork_mutant,
        }
        with suppress(NoLongerNeeded):
            while True:
                request = self.receive_request()
                self.reap_ended_children()
                reply = methods_by_request[request.pop("do")](**request)
                if reply is not None:
                    self.send_reply(reply)

    def receive_request(self) -> Any:
        return marshal.loads(self.read_bytes(struct.unpack("<I", self.read_bytes(4))[0]))

    def read_bytes(self, byte_count: int) -> bytes:
        data = b""
        while len(data) < byte_count:
            try:
                part = self.connection.recv(byte_count - len(data))
            except ConnectionError:
                raise NoLongerNeeded from None
            if not part:
                raise NoLongerNeeded
            data += part
        return data

    def fork_waiting_process(self, step: int, args: list[str] | None = None) -> None:
        """Fork a process that waits before `step` of this golden run, or of a new one with the arguments
        `args`.

        The reply carries the new process's socket.
        """
        child_socket, harness_socket = socket.socketpair()
        prepare_to_fork()
        processes = self.count_run_processes()
        if pid := os.fork():
            self.is_waiting[pid] = 1
        else:
            try:
                self.inherited_processes = processes
                harness_socket.close()
                self.connection.close()
                self.connection = child_socket
                self.wait_in_branch(step, args)
            finally:
                os._exit(0)
        child_socket.close()
        self.send_reply({"threads": thread_names.other_thread_names()}, harness_socket.fileno())
        harness_socket.close()

    def wait_in_branch(self, step: int, args: list[str] | None) -> None:
        try:
            if args is not None:
                sys.argv = [self.start_message["module"], *args]
                self.golden_run = self.begin_run(args)
            reply = self.advance_to_step(step)
        except BaseException as err:
            reply = {"failed": run_once.describe_failure(err, self.start_message["tree"], None)}
        self.send_reply(reply)
        self.serve_requests()

    def advance_to_step(self, step: int) -> dict[str, Any]:
        while self.step < step and not self.golden_run.done:
            self.golden_run.step()
            self.step += 1
        gc.freeze()
        return {"step": self.step}

    def load_modules(self, modules: list[str]) -> dict[str, Any]:
        """Import modules that mutants will need. The mutant's own import reports failures."""
        for name in modules:
            with suppress(Exception):
                importlib.import_module(name)
        self.files_outside_tree = self.files_imported_elsewhere(sys.modules)
        gc.freeze()
        return {"threads": thread_names.other_thread_names()}

    def fork_mutant(self, job: bytes, home: str, wall_s: float, disk_mb: int) -> dict[str, Any] | None:
        """Fork and guard a child that continues as a mutant; reply how it ended, with its report and log.

        Only the child unmarshals the job, because memory that this process writes to must be copied after
        each fork.
        """
        if others := thread_names.other_thread_names():
            return {"threads": others, "processes": 0}
        if processes := self.count_run_processes():
            return {"threads": [], "processes": processes}
        output = fork_output.ForkOutput()
        space_limit = process_guard.DiskGrowthLimit(home, disk_mb, (output.log, output.report))
        self.loaded_files.update()
        prepare_to_fork()
        ending = process_guard.fork_guarded(self.connection.fileno(), wall_s=wall_s, space_limit=space_limit)
        if ending is None:
            self.become_mutant(marshal.loads(job), output)
        if ending["stopped"] == process_guard.ABANDONED:
            raise NoLongerNeeded
        reply = {**ending, "threads": [], "processes": 0, "touched": self.was_tree_changed()}
        self.send_reply(reply, output.report, output.log)
        output.close()
        return None

    def count_run_processes(self) -> int:
        """Count the processes that the golden run has started, which its forks would share."""
        children = process_guard.child_pids(os.getpid())
        return self.inherited_processes + sum(not self.is_waiting[pid] for pid in children)

    def reap_ended_children(self) -> None:
        with suppress(ChildProcessError):
            while pid := os.waitpid(-1, os.WNOHANG)[0]:
                self.is_waiting[pid] = 0

    def become_mutant(self, job: dict[str, Any], output: Any) -> NoReturn:
        """In a new child: continue the run to its end as a mutant, and report."""
        self.connection.close()
        self.is_waiting.close()
        output.print_to_log()
        self.use_temporary_folder(job["home"])
        run_once.limit_resources(job)
        os.chdir(job["out"])
        report = self.run_mutant_to_end(job, output)
        imported_modules = run_once.modules_imported_since(job["probe_name"])
        report["outside"] = self.files_outside_tree + self.files_imported_elsewhere(imported_modules)
        report["modules"] = run_once.third_party_names(imported_modules, self.start_message["packages"])
        report["threads"] = thread_names.other_thread_names()
        output.write_report(report)
        if job["watch"] is None or not report["threads"]:  # a golden run with other threads is not used
            run_exit_handlers_and_flush()
        os._exit(0)

    def describe_crash(self, err: BaseException, new_codes: list[Any]) -> Any:
        errors = run_once.exception_chain(err)
        frames = [run_once.tree_frames(error, self.start_message["tree"]) for error in errors]
        return crash_description.describe_crash(errors, frames, new_codes)

    def with_shared_parts(self, parts: list[Any]) -> list[Any]:
        """Return parts of a job, with those in the place of numbers that the server got when it started."""
        shared = self.start_message["shared"]
        return [shared[part] if isinstance(part, int) else part for part in parts]

    def use_temporary_folder(self, home: str) -> None:
        """Make `home` the folder for temporary files, even if `tempfile` has already chosen the server's."""
        os.environ["TMPDIR"] = home
        tempfile: Any = sys.modules.get("tempfile")
        if tempfile is not None and tempfile.tempdir == self.start_message["home"]:
            tempfile.tempdir = home

    def files_imported_elsewhere(self, names: Iterable[str]) -> Any:
        return run_once.files_imported_elsewhere(
            self.start_message["packages"], self.start_message["tree"], names
        )

    def was_tree_changed(self) -> bool:
        try:
            return bool(run_once.change_stamp(self.tree_paths) != self.first_tree_stamp)
        except OSError:
            return True

    def run_mutant_to_end(self, job: dict[str, Any], output: Any) -> dict[str, Any]:
        report: dict[str, Any] = {"ended": "ok", "error": None, "disk_full": False, "probe": None}
        watch = job["watch"]
        probe, modules_before = None, set() if watch is None else set(sys.modules)
        functions: list[Any] = []
        is_driving = False
        try:
            probe = mutant_installation.install_probe(job["probe_name"], self.with_shared_parts(job["probe"]))
            functions = self.with_shared_parts(job["functions"])
            mutant_installation.swap_code(functions, probe, self.loaded_files)
            mutant_installation.run_probe_value_setters(job["settings"], probe)
            probe.limit(job["steps"])
            run_once.call_at_first_activation(probe, output.note_activation)
            run_once.child_activations.count_in_children(probe, job["child_activations"])
            # give the probe the state that it would have if it had observed from the start
            holder, state = job["probe_state"]
            for name, value in state.items():
                setattr(getattr(probe, holder), name, value)
            observations = (
                None if watch is None else mutant_installation.keep_observations(probe, holder, watch)
            )
            run = self.begin_run(job["args"]) if self.golden_run is None else self.golden_run
            if observations is not None:
                report |= {
                    "seen": observations,
                    "before": mutant_installation.run_counting_observations(run, observations),
                }
            is_driving = True
            report["stopped"] = early_stop.drive_run(run, job["stop"])
            is_driving = False
            run.write(Path(job["out"]))
            run_once.write_defence_report(job)
            if observations is not None:
                report["libraries"] = run_once.new_modules_outside_packages(
                    modules_before, self.start_message["packages"]
                )
        except mutant_installation.SwapRefused as why:
            report |= {"ended": "swap refused", "why": str(why)}
        except BaseException as err:
            report |= run_once.describe_failure(err, self.start_message["tree"], job["probe_name"])
            if is_driving:
                report["crash"] = self.describe_crash(err, [new for _, _, _, new in functions])
        report["executed"] = self.function_recorder.as_json()
        if probe is not None:
            report |= run_once.collect_probe_report(probe, self.start_message["tree"], job["probe_name"])
            run_once.child_activations.add_children(report["probe"], job["child_activations"])
        return report


def prepare_to_fork() -> None:
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    gc.freeze()


def run_exit_handlers_and_flush() -> None:
    """Do what an interpreter does at exit, except freeing its memory, which takes longer than many runs.

    That is: end the threads of `threading`, call `atexit` handlers, and flush open files.
    """
    if "threading" in sys.modules:
        sys.modules["threading"]._shutdown()
    atexit._run_exitfuncs()
    for tracked_object in gc.get_objects():  # only new ones, because those from before the fork are frozen
        if isinstance(tracked_object, _FILE_BASE):
            with suppress(Exception):
                tracked_object.flush()
    for stream in (sys.stdout, sys.stderr):
        stream.flush()


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2]))
