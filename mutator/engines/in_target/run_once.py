"""One run of a target in a fresh interpreter: `python -P -s child.py job.json`. Standard library only.

Written to be read by nobody but this process: it imports nothing of the harness, so that no harness code can
change what the target does. It limits itself, puts the tree first on sys.path, runs the entry module as
`__main__`, and writes report.json: how the run ended, what the tree was (digests of its files), whether the
package was also imported from elsewhere, and what the probe counted.
"""

import ctypes
import errno
import hashlib
import importlib
import json
import os
import resource
import runpy
import signal
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

_PR_SET_PDEATHSIG = 1
_FILE_LIMIT = 1 << 30  # bytes that a run may write into one file (a cache of pictures is large)
_HARD_CPU_EXTRA_S = 2  # who ignores SIGXCPU is killed this much later


def main(job_file: str) -> int:
    job = json.loads(Path(job_file).read_text(encoding="utf-8"))
    die_with_parent(job["parent"])
    limit_resources(job)
    os.chdir(job["out"])
    sys.path.insert(0, job["tree"])
    report: dict[str, Any] = {"schema": "child/1", "ended": "ok", "error": None, "disk_full": False}
    probe = None
    known = set(sys.modules)
    try:
        if job["probe"]:
            probe = importlib.import_module(job["probe"])
            probe.limit(job["steps"])
        run_module(job["module"], job["args"])
    except BaseException as err:
        report |= describe(err, job["tree"], probe)
    report["outside"] = imported_elsewhere(job["package"], job["tree"], sys.modules)
    report["modules"] = third_party(known, job["package"])
    report["files"] = tree_files(job["tree"])
    report["probe"] = probe.report() if probe else None
    Path(job["report"]).write_text(json.dumps(report), encoding="utf-8")
    return 0


def die_with_parent(parent: int) -> None:
    """Have the kernel kill this process when its parent dies (not on Linux: the CPU limit ends it)."""
    if sys.platform == "linux":
        prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def prctl(option: int, value: int) -> None:
    ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def limit_resources(job: dict[str, Any]) -> None:
    memory = job["memory_mb"] << 20
    resource.setrlimit(resource.RLIMIT_CPU, (job["cpu_s"], job["cpu_s"] + _HARD_CPU_EXTRA_S))
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_FSIZE, (_FILE_LIMIT, _FILE_LIMIT))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def run_module(module: str, args: list[str]) -> None:
    """Run `module` as `python -m` would; leaving with status 0 is a good end."""
    sys.argv = [module, *args]
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    except SystemExit as end:
        if end.code not in (None, 0):
            raise


def describe(err: BaseException, tree: str, probe: Any) -> dict[str, Any]:
    """How a run ended that did not end well, in words that are the same each time."""
    if probe is not None and isinstance(err, probe.StepLimit):
        return {"ended": "steps"}
    where = place(err, tree)
    text = f"exit status {err.code}" if isinstance(err, SystemExit) else type(err).__name__
    if str(err) and not isinstance(err, SystemExit):
        text += f": {err}"
    full = isinstance(err, OSError) and err.errno in (errno.ENOSPC, errno.EDQUOT)
    return {"ended": "error", "error": text + where, "disk_full": full}


def place(err: BaseException, tree: str) -> str:
    """` (file:line)` of the innermost frame that is in the tree."""
    found = ""
    frame = err.__traceback__
    while frame is not None:
        file = frame.tb_frame.f_code.co_filename
        if file.startswith(tree + os.sep):
            found = f" ({os.path.relpath(file, tree)}:{frame.tb_lineno})"
        frame = frame.tb_next
    return found


def imported_elsewhere(package: str, tree: str, names: Iterable[str]) -> list[str]:
    """Files of the package that were imported from outside the tree, among the modules of these names."""
    found = []
    for name in sorted(name for name in names if name.partition(".")[0] == package):
        file = getattr(sys.modules[name], "__file__", None)
        if file and not file.startswith(tree + os.sep):
            found.append(file)
    return found


def imported_since(name: str) -> list[str]:
    """The modules that were imported after that one, newest first, and itself."""
    names = []
    for newer in reversed(sys.modules):
        names.append(newer)
        if newer == name:
            break
    return names


def libraries(known: set[str], package: str) -> list[str]:
    """Modules that were imported beside the `known` ones, in that order, but for those of the package."""
    return [name for name in sys.modules if name not in known and name.partition(".")[0] != package]


def third_party(known: set[str], package: str) -> list[str]:
    """Top-level names of what was imported beside the `known` modules, but for those of the package and the
    standard library."""
    return sorted({name.partition(".")[0] for name in libraries(known, package)} - sys.stdlib_module_names)


def tree_files(tree: str) -> dict[str, str]:
    """Digest of every file of the tree but bytecode, by its path in it."""
    files = {}
    for folder, _, names in os.walk(tree):
        if Path(folder).name != "__pycache__":
            for name in names:
                path = Path(folder, name)
                files[str(path.relative_to(tree))] = hashlib.sha256(path.read_bytes()).hexdigest()
    return files


def places(tree: str) -> list[str]:
    """Every folder and file of the tree, but for bytecode: that is checked by its source's hash when used."""
    found = []
    for folder, _, files in os.walk(tree):
        if Path(folder).name != "__pycache__":
            found += [f"{folder}/{name}" for name in ("", *files)]
    return found


def stamp(places: list[str]) -> list[tuple[int, int, int]]:
    """What changes when one of them is written to, or a file is put there or taken away."""
    states = map(os.stat, places)
    return [(state.st_mtime_ns, state.st_size, state.st_ino) for state in states]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
