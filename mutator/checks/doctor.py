"""Check whether this machine can run campaigns."""

import fcntl
import importlib.metadata
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from packaging.requirements import Requirement

from mutator._common.cpu_cores import usable_cores
from mutator._common.message_text import counted
from mutator.checks.fast_engine_check import loading
from mutator.checks.findings import Finding, Level
from mutator.engines.sandbox import shortcoming as shortcoming_of_sandbox
from mutator.errors import MutatorError
from mutator.targets.required_packages import MISSING, check_requirements, shortcoming

if TYPE_CHECKING:
    from mutator.workspace import Workspace

OLDEST_PYTHON = (3, 11)
LITTLE_DISK = 200e6  # bytes; about a hundred experiments with traces
LITTLE_MEMORY = 1e9  # bytes; two controllers with their solvers, and the runner


def examine(workspace: "Workspace | MutatorError") -> list[Finding]:
    """Check interpreter, packages, machine, current folder, child processes, library and targets (including
    whether each can be forked). If no workspace was found, `workspace` is the error, which is reported.
    """
    findings = [_python(), *_packages(), _cores(), _memory(), _disk(), _folder(), _child(), _sandbox()]
    if isinstance(workspace, MutatorError):
        remedy = workspace.remedy or ""
        findings.append(Finding(name="library", level=Level.FAIL, found=workspace.got, remedy=remedy))
    else:
        findings += _library(workspace)
    return findings


def _python() -> Finding:
    found = f"{sys.version.split()[0]} at {sys.executable}"
    if sys.version_info >= OLDEST_PYTHON:
        return Finding(name="python", level=Level.OK, found=found)
    return Finding(name="python", level=Level.FAIL, found=found, remedy="use Python 3.11 or newer")


def _packages() -> Iterator[Finding]:
    for line in importlib.metadata.requires("mutator") or ():
        wanted = Requirement(line)
        if wanted.marker and not wanted.marker.evaluate({"extra": ""}):
            continue
        remedy = f"pip install '{wanted.name}{wanted.specifier}'"
        problem = shortcoming(wanted)
        if not problem:
            found = importlib.metadata.version(wanted.name)
            yield Finding(name=wanted.name, level=Level.OK, found=found)
        else:
            level = Level.FAIL if problem == MISSING else Level.WARN
            yield Finding(name=wanted.name, level=level, found=problem, remedy=remedy)


def _cores() -> Finding:
    usable = usable_cores()
    return Finding(
        name="cores", level=Level.OK, found=f"{usable} usable, so `run` uses {counted(usable, 'worker')}"
    )


def _memory() -> Finding:
    free = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    level = Level.OK if free > LITTLE_MEMORY else Level.WARN
    remedy = "" if level is Level.OK else "run fewer experiments in parallel (-n 1)"
    return Finding(name="memory", level=level, found=f"{free / 1e9:.1f} GB free", remedy=remedy)


def _disk() -> Finding:
    free = shutil.disk_usage(Path.cwd()).free
    level = Level.OK if free > LITTLE_DISK else Level.WARN
    remedy = "" if level is Level.OK else "free some space, or set --out to another disk"
    return Finding(name="disk", level=level, found=f"{free / 1e9:.1f} GB free here", remedy=remedy)


def _folder() -> Finding:
    here = Path.cwd()
    try:
        with tempfile.TemporaryFile(dir=here) as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as e:
        remedy = "set --out to a folder that can be written and locked"
        return Finding(name="folder", level=Level.WARN, found=f"{here}: {e.strerror}", remedy=remedy)
    return Finding(name="folder", level=Level.OK, found=f"{here} can be written and locked")


def _child() -> Finding:
    command = [sys.executable, "-P", "-s", "-c", "import numpy; print(numpy.__version__)"]
    try:
        done = subprocess.run(command, cwd="/", capture_output=True, text=True, timeout=60, check=False)
    except (OSError, subprocess.TimeoutExpired) as e:
        return Finding(
            name="child process", level=Level.FAIL, found=str(e), remedy="fix what this message names"
        )
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return Finding(name="child process", level=Level.FAIL, found=last, remedy="repair the installation")
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    memory = "" if limit == resource.RLIM_INFINITY else f", address space limited to {limit / 1e9:.1f} GB"
    return Finding(name="child process", level=Level.OK, found=f"starts and finds its packages{memory}")


def _sandbox() -> Finding:
    if problem := shortcoming_of_sandbox():
        remedy = "needed only for `--sandbox` (docs/explanation/trust.md#the-sandbox)"
        return Finding(name="sandbox", level=Level.WARN, found=problem, remedy=remedy)
    return Finding(name="sandbox", level=Level.OK, found="`--sandbox` works")


def _library(workspace: "Workspace") -> Iterator[Finding]:
    found = f"{workspace.library}: {counted(len(workspace.spec_files()), 'spec')}"
    yield Finding(name="library", level=Level.OK, found=found)
    try:
        models = sum(1 for _ in workspace.fault_models())
        found = f"{workspace.templates}: {counted(models, 'fault model')}"
        yield Finding(name="templates", level=Level.OK, found=found)
    except MutatorError as e:
        yield Finding(name="templates", level=Level.FAIL, found=str(e), remedy=e.remedy or "")
    names = workspace.targets
    if not names:
        remedy = "add a manifest to targets/ that describes a controller tree"
        yield Finding(name="target", level=Level.FAIL, found="no manifest in the library", remedy=remedy)
    for name in names:
        try:
            manifest = workspace.manifest(name)
            check_requirements(manifest)
            overlay = f" and {manifest.overlay}" if manifest.overlay else ""
            found = f"{manifest.root}{overlay}: {counted(len(manifest.tree.files), 'file')}"
            yield Finding(name=f"target {name}", level=Level.OK, found=found)
            yield replace(loading(manifest), name=f"fast engines, {name}")
        except MutatorError as e:
            yield Finding(name=f"target {name}", level=Level.FAIL, found=str(e), remedy=e.remedy or "")
