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
import json
import marshal
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
mutant_installation, thread_names = run_once.beside("mutant_installation"), run_once.beside("thread_names")
early_stop = run_once.beside("early_stop")


def main(connection: int, start_file: str) -> int:
    if process_guard.fork(connection) is not None:
        return 0
    try:
        serve_first(connection, marshal.loads(Path(start_file).read_bytes()))
    finally:
        os._exit(0)  # skip exit handlers, which belong to the server, not to the target's runs


def serve_first(connection: int, start: dict[str, Any]) -> None:
    os.chdir(start["home"])
    sys.path.insert(0, start["tree"])
    sys.meta_path.insert(0, run_once.Harness)
    sys.argv = [start["module"]]
    server = Process(start, socket.socket(fileno=connection))
    try:
        module = importlib.import_module(start["module"])
        server.begin = operator.attrgetter(start["stepwise"])(module)
    except BaseException as err:
        server.send({"failed": run_once.describe(err, start["tree"], None)})
        return
    gc.collect()
    server.send({"threads": thread_names.others(), "group": os.getpgrp()})
    server.serve()


class Abandoned(Exception):
    """The process is no longer needed."""


class Process:
    """A waiting process. `run` is its golden run, stopped before `step`; None before any run."""

    def __init__(self, start: dict[str, Any], connection: socket.socket) -> None:
        self.start = start
        self.connection = connection
        self.places = run_once.places(start["tree"])
        self.stamp = run_once.stamp(self.places)
        self.outside: list[str] = []  # files outside the tree from which the target's packages were imported
        self.begin: Any = None
        self.run: Any = None
        self.step = 0

    def send(self, reply: dict[str, Any], handle: int | None = None) -> None:
        data = marshal.dumps(reply)
        more = [] if handle is None else [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", [handle]))]
        self.connection.sendmsg([struct.pack("<I", len(data))], more)
        self.connection.sendall(data)

    def serve(self) -> None:
        answers: dict[str, Callable[..., dict[str, Any] | None]] = {
            "branch": self.branch,
            "advance": self.advance,
            "load": self.load,
            "mutant": self.mutant,
        }
        with suppress(Abandoned):
            while True:
                request = self.receive()
                reap()
                reply = answers[request.pop("do")](**request)
                if reply is not None:
                    self.send(reply)

    def receive(self) -> Any:
        return marshal.loads(self.read(struct.unpack("<I", self.read(4))[0]))

    def read(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            try:
                part = self.connection.recv(count - len(data))
            except ConnectionError:
                raise Abandoned from None
            if not part:
                raise Abandoned
            data += part
        return data

    def branch(self, step: int, args: list[str] | None = None) -> None:
        """Fork a process that waits before `step` of this golden run, or of a new one with the arguments
        `args`.

        The reply carries the new process's socket.
        """
        ours, theirs = socket.socketpair()
        get_ready()
        if not os.fork():
            try:
                theirs.close()
                self.connection.close()
                self.connection = ours
                self.go_on(step, args)
            finally:
                os._exit(0)
        ours.close()
        self.send({"threads": thread_names.others()}, theirs.fileno())
        theirs.close()

    def go_on(self, step: int, args: list[str] | None) -> None:
        try:
            if args is not None:
                sys.argv = [self.start["module"], *args]
                self.run = self.begin(args)
            reply = self.advance(step)
        except BaseException as err:
            reply = {"failed": run_once.describe(err, self.start["tree"], None)}
        self.send(reply)
        self.serve()

    def advance(self, step: int) -> dict[str, Any]:
        while self.step < step and not self.run.done:
            self.run.step()
            self.step += 1
        gc.freeze()
        return {"step": self.step}

    def load(self, modules: list[str]) -> dict[str, Any]:
        """Import modules that mutants will need. The mutant's own import reports failures."""
        for name in modules:
            with suppress(Exception):
                importlib.import_module(name)
        self.outside = self.elsewhere(sys.modules)
        gc.freeze()
        return {"threads": thread_names.others()}

    def mutant(self, job: bytes, home: str, wall_s: float, disk_mb: int) -> dict[str, Any]:
        """Fork and guard a child that continues as a mutant; return how it ended.

        Only the child unmarshals the job, because memory that this process writes to must be copied after
        each fork.
        """
        if others := thread_names.others():
            return {"threads": others}
        space = process_guard.Space(home, disk_mb)
        get_ready()
        ended = process_guard.fork(self.connection.fileno(), wall_s=wall_s, space=space)
        if ended is None:
            self.become(marshal.loads(job))
        if ended["stopped"] == process_guard.ABANDONED:
            raise Abandoned
        return {**ended, "threads": [], "touched": self.touched()}

    def become(self, job: dict[str, Any]) -> NoReturn:
        """In a new child: continue the run to its end as a mutant, and report."""
        self.connection.close()
        log = os.open(job["log"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
        os.dup2(log, 1)
        os.dup2(log, 2)
        os.close(log)
        self.use_folder(job["home"])
        run_once.limit_resources(job)
        os.chdir(job["out"])
        report = self.finish(job)
        report["outside"] = self.outside + self.elsewhere(run_once.imported_since(job["probe_name"]))
        report["threads"] = thread_names.others()
        Path(job["report"]).write_text(json.dumps(report), encoding="utf-8")
        if not report["threads"]:  # with other threads, the result is not used
            end()
        os._exit(0)

    def use_folder(self, home: str) -> None:
        """Make `home` the folder for temporary files, even if `tempfile` has already chosen the server's."""
        os.environ["TMPDIR"] = home
        tempfile: Any = sys.modules.get("tempfile")
        if tempfile is not None and tempfile.tempdir == self.start["home"]:
            tempfile.tempdir = home

    def elsewhere(self, names: Iterable[str]) -> Any:
        return run_once.imported_elsewhere(self.start["packages"], self.start["tree"], names)

    def touched(self) -> bool:
        try:
            return bool(run_once.stamp(self.places) != self.stamp)
        except OSError:
            return True

    def finish(self, job: dict[str, Any]) -> dict[str, Any]:
        report: dict[str, Any] = {"ended": "ok", "error": None, "disk_full": False, "probe": None}
        watch = job["watch"]
        probe, known = None, set() if watch is None else set(sys.modules)
        try:
            probe = mutant_installation.install(job["probe_name"], job["probe"])
            mutant_installation.swap_code(job["functions"], probe)
            mutant_installation.run_settings(job["settings"], probe)
            probe.limit(job["steps"])
            run_once.note_activation(probe, job["inactive"])
            # give the probe the state that it would have if it had observed from the start
            holder, state = job["probe_state"]
            for name, value in state.items():
                setattr(getattr(probe, holder), name, value)
            seen = None if watch is None else mutant_installation.keep_observations(probe, holder, watch)
            run = self.begin(job["args"]) if self.run is None else self.run
            if seen is not None:
                report |= {"seen": seen, "before": mutant_installation.observations_before_steps(run, seen)}
            report["stopped"] = early_stop.drive(run, job["stop"])
            run.write(Path(job["out"]))
            if seen is not None:
                report["libraries"] = run_once.libraries(known, self.start["packages"])
        except mutant_installation.SwapRefused as why:
            report |= {"ended": "swap refused", "why": str(why)}
        except BaseException as err:
            report |= run_once.describe(err, self.start["tree"], job["probe_name"])
        if probe is not None:
            report |= run_once.asked(probe, self.start["tree"], job["probe_name"])
        return report


def get_ready() -> None:
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    gc.freeze()


def end() -> None:
    """Do what an interpreter does at exit, except freeing its memory, which takes longer than many runs.

    That is: end the threads of `threading`, call `atexit` handlers, and flush open files.
    """
    if "threading" in sys.modules:
        sys.modules["threading"]._shutdown()
    atexit._run_exitfuncs()
    for thing in gc.get_objects():  # only new ones, because those from before the fork are frozen
        if isinstance(thing, io.IOBase):
            with suppress(Exception):
                thing.flush()
    for stream in (sys.stdout, sys.stderr):
        stream.flush()


def reap() -> None:
    with suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2]))
