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
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

_NO_SPACE_ERRNOS = (errno.ENOSPC, errno.EDQUOT)
_MOST_MESSAGE_CHARACTERS = 2000  # maximum length of a stored exception message, in characters
# maximum number of stored exceptions: the one raised, its causes and those that it groups
_MOST_STORED_EXCEPTIONS = 50


def load_neighbour(name: str) -> Any:
    """Load a module from this file's folder, which is not on sys.path."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


process_guard = load_neighbour("process_guard")
child_activations = load_neighbour("child_activations")


class HarnessImportFinder:
    """Import hook that finds `mutator`, which the target's glue imports, next to this file.

    Other installed versions are ignored.
    """

    package_folder = Path(__file__).resolve().parents[2]

    @classmethod
    def find_spec(cls, name: str, path: Any = None, target: Any = None) -> Any:
        if name != cls.package_folder.name:
            return None
        return importlib.util.spec_from_file_location(
            name, cls.package_folder / "__init__.py", submodule_search_locations=[str(cls.package_folder)]
        )


def main(job_file: str, connection_fd: int) -> int:
    job = json.loads(Path(job_file).read_text(encoding="utf-8"))
    space_limit = process_guard.DiskGrowthLimit(job["home"], job["disk_mb"])
    ending = process_guard.fork_guarded(connection_fd, wall_s=job["wall_s"], space_limit=space_limit)
    if ending is None:
        os.close(connection_fd)
        process_guard.restore_default_signals()
        run_job(job)
    else:
        ending["cpu_s"] += time.process_time()  # includes the interpreter's start
        with suppress(BrokenPipeError):  # the harness is gone
            os.write(connection_fd, json.dumps(ending).encode())
        os._exit(0)
    return 0


def run_job(job: dict[str, Any]) -> None:
    limit_resources(job)
    os.chdir(job["out"])
    sys.path.insert(0, job["tree"])
    sys.meta_path.insert(0, HarnessImportFinder)
    report: dict[str, Any] = {"schema": "child/1", "ended": "ok", "error": None, "disk_full": False}
    probe = None
    modules_before = set(sys.modules)
    watcher = (
        load_neighbour("nondeterminism_watch").NondeterminismWatcher(job["tree"]) if job["watch"] else None
    )
    line_recorder = (
        load_neighbour("line_recorder").LineRecorder(job["tree"], *job["lines"]) if job["lines"] else None
    )
    if job["types"]:
        line_recorder = load_neighbour("type_recorder").TypeRecorder(job["tree"], *job["types"])
    function_recorder = None
    if job["functions"]:
        function_recorder = load_neighbour("function_recorder").FunctionRecorder(job["tree"])
    observations: list[Any] = []
    reach_watcher = None
    try:
        if watcher:
            watcher.begin()
        if line_recorder:
            line_recorder.begin()
        if function_recorder:
            function_recorder.begin()
        if job["probe"]:
            probe = importlib.import_module(job["probe"])
            probe.limit(job["steps"])
            if job["watched_places"]:
                watch = load_neighbour("reach_watch").ReachWatcher
                reach_watcher = watch(probe, job["tree"], job["watched_places"])
                reach_watcher.begin()
            call_at_first_activation(probe, Path(job["inactive"]).unlink)
            child_activations.count_in_children(probe, job["child_activations"])
        if probe and job["observe"]:
            observations = load_neighbour("mutant_installation").keep_observations(probe, *job["observe"])
        if probe and watcher:
            watcher.watch_threads(probe, observations)
        if job["step_by_step"]:
            report["stepwise"] = run_step_by_step(job, observations, modules_before)
        elif job["stop"] is None:
            run_module(job["module"], job["args"])
        else:
            report["stopped"] = run_until_stopped(job)
        write_defence_report(job)
    except BaseException as err:
        report |= describe_failure(err, job["tree"], job["probe"])
    if function_recorder:
        report["executed"] = function_recorder.as_json()
    if job["observe"]:
        stepwise = report.pop("stepwise", {})
        report["watched"] = {**(watcher.as_json() if watcher else {}), "seen": observations, **stepwise}
    if line_recorder:
        report["lines"] = line_recorder.stop_and_collect()
        if job["types"]:
            report["types"] = line_recorder.collect_types()
    report |= collect_probe_report(probe, job["tree"], job["probe"]) if probe else {"probe": None}
    child_activations.add_children(report["probe"], job["child_activations"])
    if reach_watcher:
        report["reach"] = reach_watcher.as_json()
    report["outside"] = files_imported_elsewhere(job["packages"], job["tree"], sys.modules)
    report["modules"] = third_party_modules(modules_before, job["packages"])
    report["files"] = tree_file_digests(job["tree"])
    Path(job["report"]).write_text(json.dumps(report), encoding="utf-8")


def limit_resources(job: dict[str, Any]) -> None:
    memory, disk = job["memory_mb"] << 20, job["disk_mb"] << 20
    resource.setrlimit(resource.RLIMIT_CPU, (job["cpu_s"], job["cpu_s"] + process_guard.HARD_CPU_EXTRA_S))
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_FSIZE, (disk, disk))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # a core file would use up the disk space of the run


def run_module(module: str, args: list[str]) -> None:
    """Run `module` like `python -m`. Exit status 0 counts as success."""
    sys.argv = [module, *args]
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    except SystemExit as end:
        if end.code not in (None, 0):
            raise


def run_step_by_step(
    job: dict[str, Any], observations: list[Any], modules_before: set[str]
) -> dict[str, Any]:
    """Run and write the results; return what a fork of this run must know.

    * `before`: the number of observations before each step
    * `libraries`: the modules outside the target that the run imported
    * `threads`: the names of the other threads at its end
    """
    stepped = begin_stepwise_run(job)
    counts = load_neighbour("mutant_installation").run_counting_observations(stepped, observations)
    stepped.write(Path(job["out"]))
    libraries = new_modules_outside_packages(modules_before, job["packages"])
    threads = load_neighbour("thread_names").other_thread_names()
    return {"before": counts, "libraries": libraries, "threads": threads}


def begin_stepwise_run(job: dict[str, Any]) -> Any:
    sys.argv = [job["module"], *job["args"]]
    begin = operator.attrgetter(job["stepwise"])(importlib.import_module(job["module"]))
    return begin(job["args"])


def run_until_stopped(job: dict[str, Any]) -> bool:
    """Run and write the results; return whether the job's `stop` ended the run early."""
    stepped = begin_stepwise_run(job)
    stopped: bool = load_neighbour("early_stop").drive_run(stepped, job["stop"])
    stepped.write(Path(job["out"]))
    return stopped


def write_defence_report(job: dict[str, Any]) -> None:
    """Write what the defences of the tree did beside the target's own files, if there are any."""
    if job["defences"]:
        module, file = job["defences"]
        Path(job["out"], file).write_text(json.dumps(sys.modules[module].report()), encoding="utf-8")


def call_at_first_activation(probe: Any, note: Callable[[], None]) -> None:
    """Call `note` at the first activation, which is then known even if the run crashes."""
    active = probe.active

    def first_active(fi: str) -> Any:
        acts = active(fi)
        if acts:
            probe.active = active
            with suppress(OSError):
                note()
        return acts

    probe.active = first_active


def collect_probe_report(probe: Any, tree: str, probe_name: str) -> dict[str, Any]:
    """Return the report of the probe `probe_name`. If the probe fails, its error becomes the run's ending."""
    try:
        report = probe.report()
    except BaseException as err:
        return {"probe": None, **describe_failure(err, tree, probe_name)}
    try:
        json.dumps(report)
    except Exception:
        report = "what JSON cannot tell"  # the run has overwritten the probe's data
    return {"probe": report}


def describe_failure(err: BaseException, tree: str, probe_name: str | None) -> dict[str, Any]:
    """Describe reproducibly how a run failed. `probe_name` is the name of the probe's module."""
    kind = type(err)
    if probe_name and (kind.__module__, kind.__name__) == (probe_name, "StepLimit"):
        return {"ended": "steps"}
    message = safe_text_of(err.code if isinstance(err, SystemExit) else err)[:_MOST_MESSAGE_CHARACTERS]
    errors = exception_chain(err)
    error = {
        "kind": kind.__name__,
        "message": message,
        "stacks": [tree_stack(error, tree) for error in errors],
    }
    return {"ended": "error", "error": error, "disk_full": any(map(is_full_disk_error, errors))}


def safe_text_of(value: object) -> str:
    """Convert an object to text, even if its own conversion fails."""
    try:
        return str(value)
    except BaseException as why:
        return f"its text cannot be told ({type(why).__name__})"


def is_full_disk_error(err: BaseException) -> bool:
    """Return whether an error reports a full disk or quota, even if a library raised it."""
    return getattr(err, "errno", None) in _NO_SPACE_ERRNOS or any(
        os.strerror(n) in safe_text_of(err) for n in _NO_SPACE_ERRNOS
    )


def exception_chain(err: BaseException) -> list[BaseException]:
    """Return the exception, its causes, and the exceptions that it groups, without duplicates."""
    errors_by_id: dict[int, BaseException] = {}
    todo: list[BaseException | None] = [err]
    while todo and len(errors_by_id) < _MOST_STORED_EXCEPTIONS:
        error = todo.pop()
        if error is not None and id(error) not in errors_by_id:
            errors_by_id[id(error)] = error
            inner = error.exceptions if isinstance(error, BaseExceptionGroup) else ()
            # taken from the end: first the cause, then the context, then the grouped ones
            todo += [*inner, error.__context__, error.__cause__]
    return list(errors_by_id.values())


def tree_stack(err: BaseException, tree: str) -> list[tuple[str, int, int]]:
    """Return where the exception passed through the tree: file, line and column, innermost first, each line
    once.
    """
    innermost_by_line: dict[tuple[str, int], tuple[str, int, int]] = {}
    for file, line, column, _ in tree_frames(err, tree):
        innermost_by_line.setdefault((file, line), (file, line, column))
    return list(innermost_by_line.values())


def tree_frames(err: BaseException, tree: str) -> list[tuple[str, int, int, types.CodeType]]:
    """Return file, line, column and code of each frame in the tree that the exception left, innermost
    first.
    """
    frames = []
    trace = err.__traceback__
    while trace is not None:
        code = trace.tb_frame.f_code
        if code.co_filename.startswith(tree + os.sep):
            file = os.path.relpath(code.co_filename, tree)
            frames.append((file, trace.tb_lineno or 0, failing_byte_column(trace), code))
        trace = trace.tb_next
    return frames[::-1]


def failing_byte_column(trace: types.TracebackType) -> int:
    """Return the byte at which the failing or called expression starts in its line; -1 if unknown."""
    positions = trace.tb_frame.f_code.co_positions()
    # a code object has one position for each instruction of two bytes
    *_, begins, _ = next(itertools.islice(positions, trace.tb_lasti // 2, None), (None,) * 4)
    return -1 if begins is None else begins


def files_imported_elsewhere(packages: Iterable[str], tree: str, module_names: Iterable[str]) -> list[str]:
    """Return the files outside the tree from which these modules of the packages were imported."""
    files = []
    for name in sorted(name for name in module_names if name.partition(".")[0] in packages):
        file = getattr(sys.modules[name], "__file__", None)
        if file and not file.startswith(tree + os.sep):
            files.append(file)
    return files


def modules_imported_since(name: str) -> list[str]:
    names = []
    for newer in reversed(sys.modules):
        names.append(newer)
        if newer == name:
            break
    return names


def new_modules_outside_packages(modules_before: set[str], packages: Iterable[str]) -> list[str]:
    return [
        name for name in sys.modules if name not in modules_before and name.partition(".")[0] not in packages
    ]


def third_party_modules(modules_before: set[str], packages: Iterable[str]) -> list[str]:
    """Return the third-party top-level modules imported after `modules_before`, or mapped into memory."""
    names = (*new_modules_outside_packages(modules_before, packages), *modules_mapped_into_memory())
    return third_party_names(names, [*packages, *modules_before])


def third_party_names(names: Iterable[str], others: Iterable[str]) -> list[str]:
    """Return the top-level names of modules, without `others`, the standard library, the harness and what
    code made at run time.
    """
    excluded = {*sys.stdlib_module_names, HarnessImportFinder.package_folder.name, *others}
    return sorted(filter(is_from_third_party, {name.partition(".")[0] for name in names} - excluded))


def is_from_third_party(name: str) -> bool:
    """Return whether a module has a file or folder outside that of the standard library, which also has
    modules that `sys.stdlib_module_names` lacks. Of a library that was only mapped into memory, True.
    """
    if name not in sys.modules:
        return True
    module, places = sys.modules[name], []
    with suppress(Exception):  # a target can put any object there
        places = [getattr(module, "__file__", None), *getattr(module, "__path__", ())]
    return any(isinstance(place, str) and Path(place).parent != Path(os.__file__).parent for place in places)


def modules_mapped_into_memory() -> Iterator[str]:
    """Yield the names, relative to module folders, of files mapped into memory.

    These include libraries that are used without an import of their package.
    """
    folders = sorted((f"{folder}/" for folder in sys.path if folder), key=len, reverse=True)
    with suppress(OSError):
        for line in Path("/proc/self/maps").read_text(errors="replace").splitlines():
            path = line[line.find("/") :]
            if folder := next(filter(path.startswith, folders), ""):
                yield path.removeprefix(folder).split("/")[0]


def tree_file_digests(tree: str) -> dict[str, str]:
    files = {}
    for folder, _, names in os.walk(tree):
        if Path(folder).name != "__pycache__":
            for name in names:
                path = Path(folder, name)
                files[str(path.relative_to(tree))] = hashlib.sha256(path.read_bytes()).hexdigest()
    return files


def list_tree_paths(tree: str) -> list[str]:
    """List every folder and file in the tree."""
    return [f"{folder}/{name}" for folder, _, files in os.walk(tree) for name in ("", *files)]


def change_stamp(paths: list[str]) -> list[tuple[int, int]]:
    """Return a value that changes when a file or folder is written to, added or removed, even if its size
    and times are put back, because only the kernel sets ctime.
    """
    states = map(os.stat, paths)
    return [(state.st_ctime_ns, state.st_ino) for state in states]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], int(sys.argv[2])))
