"""Run a target once in a fresh interpreter: `python -P -s run_once.py job.json SOCKET`.

Standard library only, because the harness must not change what the target does. The script forks. The parent
guards the child (see process_guard.py) and reports over the socket how it ended. The child limits itself,
puts the tree first on sys.path, runs the entry module as `__main__`, and writes report.json.
"""

import errno
import hashlib
import importlib
import importlib.util
import itertools
import json
import operator
import os
import resource
import runpy
import sys
import time
import types
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

_NO_SPACE = (errno.ENOSPC, errno.EDQUOT)
_LONGEST = 2000  # maximum length of a stored exception message, in characters
_MOST_ERRORS = 50  # maximum number of stored exceptions: the one raised, its causes and those that it groups


def beside(name: str) -> Any:
    """Load a module from this file's folder, which is not on sys.path."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


process_guard = beside("process_guard")


class Harness:
    """Import hook that finds `mutator`, which the target's glue imports, next to this file.

    Other installed versions are ignored.
    """

    package = Path(__file__).resolve().parents[2]

    @classmethod
    def find_spec(cls, name: str, path: Any = None, target: Any = None) -> Any:
        if name != cls.package.name:
            return None
        return importlib.util.spec_from_file_location(
            name, cls.package / "__init__.py", submodule_search_locations=[str(cls.package)]
        )


def main(job_file: str, connection: int) -> int:
    job = json.loads(Path(job_file).read_text(encoding="utf-8"))
    space = process_guard.Space(job["home"], job["disk_mb"])
    ended = process_guard.fork(connection, wall_s=job["wall_s"], space=space)
    if ended is None:
        os.close(connection)
        run(job)
    else:
        ended["cpu_s"] += time.process_time()  # includes the interpreter's start
        with suppress(BrokenPipeError):
            os.write(connection, json.dumps(ended).encode())
        os._exit(0)
    return 0


def run(job: dict[str, Any]) -> None:
    limit_resources(job)
    os.chdir(job["out"])
    sys.path.insert(0, job["tree"])
    sys.meta_path.insert(0, Harness)
    report: dict[str, Any] = {"schema": "child/1", "ended": "ok", "error": None, "disk_full": False}
    probe = None
    known = set(sys.modules)
    watcher = beside("nondeterminism_watch").Watcher(job["tree"]) if job["watch"] else None
    lines = beside("executed_lines").Lines(job["tree"], *job["lines"]) if job["lines"] else None
    seen: list[Any] = []
    try:
        if watcher:
            watcher.begin()
        if lines:
            lines.begin()
        if job["probe"]:
            probe = importlib.import_module(job["probe"])
            probe.limit(job["steps"])
            note_activation(probe, job["inactive"])
        if probe and job["observe"]:
            seen = beside("mutant_installation").keep_observations(probe, *job["observe"])
        if probe and watcher:
            watcher.look_for_threads(probe, seen)
        if job["stop"] is None:
            run_module(job["module"], job["args"])
        else:
            report["stopped"] = run_until(job)
    except BaseException as err:
        report |= describe(err, job["tree"], job["probe"])
    if job["observe"]:
        report["watched"] = {**(watcher.found() if watcher else {}), "seen": seen}
    if lines:
        report["lines"] = lines.found()
    report |= asked(probe, job["tree"], job["probe"]) if probe else {"probe": None}
    report["outside"] = imported_elsewhere(job["packages"], job["tree"], sys.modules)
    report["modules"] = third_party(known, job["packages"])
    report["files"] = tree_files(job["tree"])
    Path(job["report"]).write_text(json.dumps(report), encoding="utf-8")


def limit_resources(job: dict[str, Any]) -> None:
    memory, disk = job["memory_mb"] << 20, job["disk_mb"] << 20
    resource.setrlimit(resource.RLIMIT_CPU, (job["cpu_s"], job["cpu_s"] + process_guard.HARD_CPU_EXTRA_S))
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_FSIZE, (disk, disk))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def run_module(module: str, args: list[str]) -> None:
    """Run `module` like `python -m`. Exit status 0 counts as success."""
    sys.argv = [module, *args]
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    except SystemExit as end:
        if end.code not in (None, 0):
            raise


def run_until(job: dict[str, Any]) -> bool:
    """Run and write the results; return whether a terminal hazard stopped the run."""
    sys.argv = [job["module"], *job["args"]]
    begin = operator.attrgetter(job["stepwise"])(importlib.import_module(job["module"]))
    stepped = begin(job["args"])
    stopped: bool = beside("early_stop").drive(stepped, job["stop"])
    stepped.write(Path(job["out"]))
    return stopped


def note_activation(probe: Any, inactive: str) -> None:
    """Delete the file `inactive` at the first activation, which is then known even if the run crashes."""
    active = probe.active

    def first_active(fi: str) -> Any:
        acts = active(fi)
        if acts:
            probe.active = active
            with suppress(OSError):
                Path(inactive).unlink()
        return acts

    probe.active = first_active


def asked(probe: Any, tree: str, name: str) -> dict[str, Any]:
    """Return the report of the probe `name`. If the probe fails, its error becomes the run's ending."""
    try:
        said = probe.report()
    except BaseException as err:
        return {"probe": None, **describe(err, tree, name)}
    try:
        json.dumps(said)
    except Exception:
        said = "what JSON cannot tell"  # the run has overwritten the probe's data
    return {"probe": said}


def describe(err: BaseException, tree: str, probe: str | None) -> dict[str, Any]:
    """Describe reproducibly how a run failed. `probe` is the name of the probe's module."""
    kind = type(err)
    if probe and (kind.__module__, kind.__name__) == (probe, "StepLimit"):
        return {"ended": "steps"}
    message = text(err.code if isinstance(err, SystemExit) else err)[:_LONGEST]
    errors = origins(err)
    error = {"kind": kind.__name__, "message": message, "stacks": [passed(one, tree) for one in errors]}
    return {"ended": "error", "error": error, "disk_full": any(map(of_full_disk, errors))}


def text(thing: object) -> str:
    """Convert an object to text, even if its own conversion fails."""
    try:
        return str(thing)
    except BaseException as why:
        return f"its text cannot be told ({type(why).__name__})"


def of_full_disk(err: BaseException) -> bool:
    """Return whether an error reports a full disk or quota, even if a library raised it."""
    return getattr(err, "errno", None) in _NO_SPACE or any(os.strerror(n) in text(err) for n in _NO_SPACE)


def origins(err: BaseException) -> list[BaseException]:
    """Return the exception, its causes, and the exceptions that it groups, without duplicates."""
    found: dict[int, BaseException] = {}
    todo: list[BaseException | None] = [err]
    while todo and len(found) < _MOST_ERRORS:
        one = todo.pop()
        if one is not None and id(one) not in found:
            found[id(one)] = one
            inner = one.exceptions if isinstance(one, BaseExceptionGroup) else ()
            todo += [*inner, one.__context__, one.__cause__]
    return list(found.values())


def passed(err: BaseException, tree: str) -> list[tuple[str, int, int]]:
    """Return where the exception passed through the tree: file, line and column, innermost first."""
    places = []
    trace = err.__traceback__
    while trace is not None:
        file = trace.tb_frame.f_code.co_filename
        if file.startswith(tree + os.sep):
            places.append((os.path.relpath(file, tree), trace.tb_lineno or 0, column(trace)))
        trace = trace.tb_next
    kept: dict[tuple[str, int], tuple[str, int, int]] = {}
    for place in reversed(places):
        kept.setdefault(place[:2], place)
    return list(kept.values())


def column(trace: types.TracebackType) -> int:
    """Return the byte at which the failing or called expression starts in its line; -1 if unknown."""
    positions = trace.tb_frame.f_code.co_positions()
    *_, begins, _ = next(itertools.islice(positions, trace.tb_lasti // 2, None), (None,) * 4)
    return -1 if begins is None else begins


def imported_elsewhere(packages: Iterable[str], tree: str, names: Iterable[str]) -> list[str]:
    """Return the files outside the tree from which these modules of the packages were imported."""
    found = []
    for name in sorted(name for name in names if name.partition(".")[0] in packages):
        file = getattr(sys.modules[name], "__file__", None)
        if file and not file.startswith(tree + os.sep):
            found.append(file)
    return found


def imported_since(name: str) -> list[str]:
    names = []
    for newer in reversed(sys.modules):
        names.append(newer)
        if newer == name:
            break
    return names


def libraries(known: set[str], packages: Iterable[str]) -> list[str]:
    return [name for name in sys.modules if name not in known and name.partition(".")[0] not in packages]


def third_party(known: set[str], packages: Iterable[str]) -> list[str]:
    """Return the third-party top-level modules imported since the `known` ones or mapped into memory."""
    own = {*sys.stdlib_module_names, Harness.package.name, *packages, *known}
    return sorted({name.partition(".")[0] for name in (*libraries(known, packages), *mapped())} - own)


def mapped() -> Iterator[str]:
    """Yield the names, relative to module folders, of files mapped into memory.

    These include libraries that are used without an import of their package.
    """
    folders = sorted((f"{folder}/" for folder in sys.path if folder), key=len, reverse=True)
    with suppress(OSError):
        for line in Path("/proc/self/maps").read_text(errors="replace").splitlines():
            path = line[line.find("/") :]
            if folder := next(filter(path.startswith, folders), ""):
                yield path.removeprefix(folder).split("/")[0]


def tree_files(tree: str) -> dict[str, str]:
    files = {}
    for folder, _, names in os.walk(tree):
        if Path(folder).name != "__pycache__":
            for name in names:
                path = Path(folder, name)
                files[str(path.relative_to(tree))] = hashlib.sha256(path.read_bytes()).hexdigest()
    return files


def places(tree: str) -> list[str]:
    """List every folder and file in the tree."""
    return [f"{folder}/{name}" for folder, _, files in os.walk(tree) for name in ("", *files)]


def stamp(places: list[str]) -> list[tuple[int, int]]:
    """Return a value that changes when a file or folder is written to, added or removed, even if its size
    and times are put back, because only the kernel sets ctime.
    """
    states = map(os.stat, places)
    return [(state.st_ctime_ns, state.st_ino) for state in states]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], int(sys.argv[2])))
