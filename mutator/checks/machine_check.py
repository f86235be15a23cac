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
from mutator._common.version import DISTRIBUTION, EARLIER_DISTRIBUTION
from mutator.checks.check_findings import CheckState, Finding
from mutator.checks.fast_engine_check import import_and_fork_finding
from mutator.engines.sandbox import reason_sandbox_unavailable as shortcoming_of_sandbox
from mutator.errors import MutatorError
from mutator.targets.required_packages import NOT_INSTALLED, check_requirements, installation_problem

if TYPE_CHECKING:
    from mutator.workspace import Workspace

OLDEST_PYTHON = (3, 11)
MIN_FREE_DISK_BYTES = 200e6  # bytes; about a hundred experiments with traces
MIN_FREE_MEMORY_BYTES = 1e9  # bytes; two controllers with their solvers, and the runner


def examine_machine(workspace: "Workspace | MutatorError") -> list[Finding]:
    """Check interpreter, packages, machine, current folder, child processes, library and targets (including
    whether each can be forked). If no workspace was found, `workspace` is the error, which is reported.
    """
    findings = [
        _python_finding(),
        *_package_findings(),
        *_earlier_distribution_findings(),
        _cores_finding(),
        _memory_finding(),
        _disk_finding(),
        _folder_finding(),
        _child_process_finding(),
        _sandbox_finding(),
    ]
    if isinstance(workspace, MutatorError):
        remedy = workspace.remedy or ""
        findings.append(Finding(name="library", level=CheckState.FAIL, found=workspace.got, remedy=remedy))
    else:
        findings += _library_findings(workspace)
    return findings


def _python_finding() -> Finding:
    python = f"{sys.version.split()[0]} at {sys.executable}"
    if sys.version_info >= OLDEST_PYTHON:
        return Finding(name="python", level=CheckState.OK, found=python)
    return Finding(name="python", level=CheckState.FAIL, found=python, remedy="use Python 3.11 to 3.14")


def _package_findings() -> Iterator[Finding]:
    try:
        lines = importlib.metadata.requires(DISTRIBUTION) or ()
    except importlib.metadata.PackageNotFoundError:
        remedy = "install it: `pip install -c constraints.txt -e .` in the clone"
        yield Finding(name=DISTRIBUTION, level=CheckState.WARN, found=NOT_INSTALLED, remedy=remedy)
        return
    for line in lines:
        requirement = Requirement(line)
        if requirement.marker and not requirement.marker.evaluate({"extra": ""}):
            continue
        remedy = f"pip install '{requirement.name}{requirement.specifier}'"
        problem = installation_problem(requirement)
        if not problem:
            version = importlib.metadata.version(requirement.name)
            yield Finding(name=requirement.name, level=CheckState.OK, found=version)
        else:
            level = CheckState.FAIL if problem == NOT_INSTALLED else CheckState.WARN
            yield Finding(name=requirement.name, level=level, found=problem, remedy=remedy)


def _earlier_distribution_findings() -> Iterator[Finding]:
    """Report another distribution with a package `mutator`: whichever was installed last has its files."""
    try:
        version = importlib.metadata.version(EARLIER_DISTRIBUTION)
    except importlib.metadata.PackageNotFoundError:
        return
    yield Finding(
        name=EARLIER_DISTRIBUTION,
        level=CheckState.WARN,
        found=f"{version} is installed, too; it overwrites the package `mutator` of {DISTRIBUTION}",
        remedy=f"`pip uninstall {EARLIER_DISTRIBUTION} {DISTRIBUTION}`, then install {DISTRIBUTION} again",
    )


def _cores_finding() -> Finding:
    usable = usable_cores()
    return Finding(
        name="cores", level=CheckState.OK, found=f"{usable} usable, so `run` uses {counted(usable, 'worker')}"
    )


def _memory_finding() -> Finding:
    free = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    level = CheckState.OK if free > MIN_FREE_MEMORY_BYTES else CheckState.WARN
    remedy = "" if level is CheckState.OK else "run fewer experiments in parallel (-n 1)"
    return Finding(name="memory", level=level, found=f"{free / 1e9:.1f} GB free", remedy=remedy)


def _disk_finding() -> Finding:
    free = shutil.disk_usage(Path.cwd()).free
    level = CheckState.OK if free > MIN_FREE_DISK_BYTES else CheckState.WARN
    remedy = "" if level is CheckState.OK else "free some space, or set --out to another disk"
    return Finding(name="disk", level=level, found=f"{free / 1e9:.1f} GB free here", remedy=remedy)


def _folder_finding() -> Finding:
    here = Path.cwd()
    try:
        with tempfile.TemporaryFile(dir=here) as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as e:
        remedy = "set --out to a folder that can be written and locked"
        return Finding(name="folder", level=CheckState.WARN, found=f"{here}: {e.strerror}", remedy=remedy)
    return Finding(name="folder", level=CheckState.OK, found=f"{here} can be written and locked")


def _child_process_finding() -> Finding:
    command = [sys.executable, "-P", "-s", "-c", "import numpy; print(numpy.__version__)"]
    try:
        child = subprocess.run(command, cwd="/", capture_output=True, text=True, timeout=60, check=False)
    except (OSError, subprocess.TimeoutExpired) as e:
        return Finding(
            name="child process", level=CheckState.FAIL, found=str(e), remedy="fix what this message names"
        )
    if child.returncode:
        last = (child.stderr.strip().splitlines() or ["no message"])[-1]
        return Finding(
            name="child process", level=CheckState.FAIL, found=last, remedy="repair the installation"
        )
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    memory = "" if limit == resource.RLIM_INFINITY else f", address space limited to {limit / 1e9:.1f} GB"
    return Finding(name="child process", level=CheckState.OK, found=f"starts and finds its packages{memory}")


def _sandbox_finding() -> Finding:
    if problem := shortcoming_of_sandbox():
        remedy = "needed only for `--sandbox` (docs/explanation/trust.md#the-sandbox)"
        return Finding(name="sandbox", level=CheckState.WARN, found=problem, remedy=remedy)
    return Finding(name="sandbox", level=CheckState.OK, found="`--sandbox` works")


def _library_findings(workspace: "Workspace") -> Iterator[Finding]:
    summary = f"{workspace.library}: {counted(len(workspace.spec_files()), 'spec')}"
    yield Finding(name="library", level=CheckState.OK, found=summary)
    try:
        models = sum(1 for _ in workspace.fault_models())
        summary = f"{workspace.templates}: {counted(models, 'fault model')}"
        yield Finding(name="templates", level=CheckState.OK, found=summary)
    except MutatorError as e:
        yield Finding(name="templates", level=CheckState.FAIL, found=str(e), remedy=e.remedy or "")
    names = workspace.targets
    if not names:
        remedy = "add a manifest to targets/ that describes a controller tree"
        yield Finding(name="target", level=CheckState.FAIL, found="no manifest in the library", remedy=remedy)
    for name in names:
        try:
            manifest = workspace.manifest(name)
            check_requirements(manifest)
            overlay = f" and {manifest.overlay}" if manifest.overlay else ""
            summary = f"{manifest.root}{overlay}: {counted(len(manifest.tree.files), 'file')}"
            yield Finding(name=f"target {name}", level=CheckState.OK, found=summary)
            yield replace(import_and_fork_finding(manifest), name=f"fast engines, {name}")
        except MutatorError as e:
            yield Finding(name=f"target {name}", level=CheckState.FAIL, found=str(e), remedy=e.remedy or "")
