"""A loaded target that forks: `python -P -s fork_server.py SOCKET START.marshal`. Standard library only.

Every process of the server waits at a step boundary of a golden run (the first one before any run), answers
on a socket of its own, and can be asked to fork: a child that goes on as a mutant, or another process that
waits some steps further on. Messages are marshalled dicts, each after its length. A process has one thread,
or does not fork. It ends when its socket is closed at the other end, or when the first process is gone.
"""

import array
import gc
import importlib
import importlib.util
import json
import marshal
import os
import select
import signal
import socket
import struct
import sys
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

_PR_SET_CHILD_SUBREAPER = 36


def _beside(name: str) -> Any:
    """The module of that name in this file's folder, which is not on sys.path."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


child = _beside("run_once")
swap = _beside("swap")


def main(connection: int, start_file: str) -> int:
    start = marshal.loads(Path(start_file).read_bytes())
    child.die_with_parent(start["parent"])
    child.prctl(_PR_SET_CHILD_SUBREAPER, 1)  # who waits for a process that went away is this one
    os.chdir(start["home"])
    sys.path.insert(0, start["tree"])
    sys.argv = [start["module"]]
    server = Process(start, socket.socket(fileno=connection))
    try:
        module = importlib.import_module(start["module"])
        server.begin = getattr(module, start["stepwise"])
    except BaseException as err:
        server.send({"failed": child.describe(err, start["tree"], None)})
        return 1
    gc.collect()
    server.send({"files": child.tree_files(start["tree"]), "threads": threads()})
    server.serve()
    os.close(server.life[1])
    while True:  # the others end now: their time counts, too
        try:
            os.wait()
        except ChildProcessError:
            return 0


class Abandoned(Exception):
    """Nobody waits for this process any more."""


class Process:
    """One waiting process. `run` is the golden run it is in the middle of, at `step`; None before any."""

    def __init__(self, start: dict[str, Any], connection: socket.socket) -> None:
        self.start = start
        self.connection = connection
        self.life = os.pipe()  # never written to: its end tells the others that the first process is gone
        self.places = child.places(start["tree"])
        self.stamp = child.stamp(self.places)
        self.outside: list[str] = []  # files of the package that were imported from elsewhere
        self.begin: Any = None
        self.run: Any = None
        self.step = 0

    def send(self, reply: dict[str, Any], handle: int | None = None) -> None:
        data = marshal.dumps(reply)
        more = [] if handle is None else [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", [handle]))]
        self.connection.sendmsg([struct.pack("<I", len(data))], more)
        self.connection.sendall(data)

    def serve(self) -> None:
        """Answer until nobody asks any more; what runs for them then ends with it."""
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
        self.wait(self.connection.fileno(), None)
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

    def wait(self, handle: int, seconds: float | None) -> bool:
        """Whether there is something on `handle` before the time is over. Ends this process when nobody waits
        for it any more."""
        ends = {self.life[0], self.connection.fileno()} - {handle}
        poll = select.poll()
        for one in (handle, *ends):
            poll.register(one, select.POLLIN)
        ready = {fd for fd, _ in poll.poll(None if seconds is None else seconds * 1000)}
        if ready & ends:
            raise Abandoned
        return handle in ready

    def branch(self, step: int, args: list[str] | None = None) -> None:
        """Fork a process that waits before `step` of this golden run, or of the one that `args` begin. Its
        socket is the reply."""
        ours, theirs = socket.socketpair()
        if not fork():
            try:
                theirs.close()
                self.connection.close()
                self.connection = ours
                self.go_on(step, args)
            finally:
                os._exit(0)
        ours.close()
        self.send({"threads": threads()}, theirs.fileno())
        theirs.close()

    def go_on(self, step: int, args: list[str] | None) -> None:
        """In a new process: get to its place, say so, and wait there."""
        if self.life[1] >= 0:
            os.close(self.life[1])
            self.life = (self.life[0], -1)
        try:
            if args is not None:
                sys.argv = [self.start["module"], *args]
                self.run = self.begin(args)
            reply = self.advance(step)
        except BaseException as err:
            reply = {"failed": child.describe(err, self.start["tree"], None)}
        self.send(reply)
        self.serve()

    def advance(self, step: int) -> dict[str, Any]:
        """Go on to before `step` of the golden run."""
        while self.step < step and not self.run.done:
            self.run.step()
            self.step += 1
        gc.freeze()
        return {"step": self.step}

    def load(self, modules: list[str]) -> dict[str, Any]:
        """Load what mutants will import; what cannot be loaded is theirs to complain about."""
        for name in modules:
            with suppress(Exception):
                importlib.import_module(name)
        self.outside = self.elsewhere(sys.modules)
        gc.freeze()
        return {"threads": threads()}

    def mutant(self, job: bytes, wall_s: float) -> dict[str, Any]:
        """Fork a child that goes on as a mutant, and wait for it; how it ended. The child reads the job: what
        this process writes to, it must copy after each fork."""
        began = time.monotonic()
        count = threads()
        if count != 1:
            return {"threads": count}
        parent, pid = os.getpid(), fork()
        if not pid:
            self.become(marshal.loads(job), parent)
        handle = os.pidfd_open(pid)
        try:
            out_of_wall = not self.wait(handle, wall_s)
        finally:
            os.close(handle)
            for kill in (os.killpg, os.kill):  # it may not have come to have a group yet
                with suppress(ProcessLookupError, PermissionError):
                    kill(pid, signal.SIGKILL)
            _, code, usage = os.wait4(pid, 0)
        return {
            "code": os.waitstatus_to_exitcode(code),
            "cpu_s": usage.ru_utime + usage.ru_stime,
            "wall_s": time.monotonic() - began,
            "out_of_wall": out_of_wall,
            "threads": count,
        }

    def become(self, job: dict[str, Any], parent: int) -> None:
        """In a new child: be a mutant of the run so far, finish it, report. Never returns."""
        os.setsid()
        child.die_with_parent(parent)
        for handle in (*self.life, self.connection.fileno()):
            if handle >= 0:
                os.close(handle)
        log = os.open(job["log"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
        os.dup2(log, 1)
        os.dup2(log, 2)
        os.close(log)
        os.environ["TMPDIR"] = job["home"]
        child.limit_resources(job)
        os.chdir(job["out"])
        report = self.finish(job)
        report["outside"] = self.outside + self.elsewhere(child.imported_since(job["probe_name"]))
        report["touched"] = self.touched()
        report["threads"] = threads()
        Path(job["report"]).write_text(json.dumps(report), encoding="utf-8")
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(0)

    def elsewhere(self, names: Iterable[str]) -> Any:
        """Files of the package that modules of these names were imported from, other than the tree's."""
        return child.imported_elsewhere(self.start["package"], self.start["tree"], names)

    def touched(self) -> bool:
        """Whether the tree is another one than it was."""
        try:
            return bool(child.stamp(self.places) != self.stamp)
        except OSError:
            return True

    def finish(self, job: dict[str, Any]) -> dict[str, Any]:
        """Drive the run to its end as the mutant; the report on it."""
        report: dict[str, Any] = {"ended": "ok", "error": None, "disk_full": False, "probe": None}
        probe, known = None, set(sys.modules) if job["watch"] else set()
        try:
            probe = swap.install(job["probe_name"], job["probe"])
            swap.swap_code(job["functions"], probe)
            probe.limit(job["steps"])
            child.note_activation(probe, job["inactive"])
            holder, state = job["probe_state"]  # what it would know had it been there from the beginning
            for name, value in state.items():
                setattr(getattr(probe, holder), name, value)
            seen = swap.keep_observations(probe, job["watch"]) if job["watch"] else None
            run = self.begin(job["args"]) if self.run is None else self.run
            if seen is not None:
                report |= {"seen": seen, "before": swap.observations_before_steps(run, seen)}
            while not run.done:
                run.step()
            run.write(Path(job["out"]))
            if seen is not None:
                report["libraries"] = child.libraries(known, self.start["package"])
        except swap.SwapRefused as why:
            report |= {"ended": "swap refused", "why": str(why)}
        except BaseException as err:
            report |= child.describe(err, self.start["tree"], job["probe_name"])
        if probe is not None:
            report |= child.asked(probe, self.start["tree"], job["probe_name"])
        return report


def fork() -> int:
    """Fork a process of one thread, whose objects the collector of the new one leaves alone."""
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    gc.freeze()
    return os.fork()


def threads() -> int:
    """Threads of this process, those of libraries included."""
    return len(list(Path("/proc/self/task").iterdir()))


def reap() -> None:
    """Take note of the children that ended."""
    with suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2]))
