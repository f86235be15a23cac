"""Finds what a run depends on: Python, operating system, processor, BLAS and packages."""

import json
import platform
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from mutator._common.version import DISTRIBUTION
from mutator.engines.process_endings import environment_variables_of_run
from mutator.store.session_environments import Blas
from mutator.targets.process_environment import THREAD_VARIABLES

# a process of its own, because variables of the environment decide which BLAS numpy loads
_BLAS_SCRIPT = "import json, numpy, threadpoolctl; print(json.dumps(threadpoolctl.threadpool_info()))"


def environment_affecting_results() -> list[Any]:
    """Return everything outside the target's sources that can affect its results."""
    return [
        python_version(),
        platform.platform(),
        processor_name(),
        loaded_blas(),
        thread_limits(),
        package_versions(),
    ]


def python_version() -> str:
    return f"{platform.python_implementation()} {platform.python_version()}"


def processor_name() -> str | None:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        text = ""
    model = re.search(r"^model name\s*:\s*(.*\S)", text, re.MULTILINE)
    return model[1] if model else platform.processor() or None


def thread_limits() -> dict[str, str]:
    """Return the thread limits for numerical libraries in the target's environment."""
    return dict.fromkeys(THREAD_VARIABLES, "1")


@lru_cache(maxsize=1)
def loaded_blas() -> tuple[Blas, ...]:
    """Return the BLAS that numpy loads in the target's environment; empty without numpy.

    `kernel` is the one that the library chose for this processor.
    """
    with tempfile.TemporaryDirectory() as folder:
        process = subprocess.run(
            [sys.executable, "-P", "-s", "-c", _BLAS_SCRIPT],
            cwd=folder,
            env=environment_variables_of_run(0, Path(folder)),
            capture_output=True,
            check=False,
        )
    loaded = json.loads(process.stdout) if process.returncode == 0 else []
    names = {"internal_api": "library", "version": "version", "architecture": "kernel"}
    names["num_threads"] = "threads"
    return tuple(
        Blas(**{field: library.get(numpy_name) for numpy_name, field in names.items()}) for library in loaded
    )


@lru_cache(maxsize=1)
def _installed_packages() -> dict[str, tuple[str, list[str]]]:
    """Return the version and requirements of each installed package.

    If a package is installed twice, return those of the copy that Python imports.
    """
    package_by_name: dict[str, tuple[str, list[str]]] = {}
    for distribution in metadata.distributions():
        package_metadata = distribution.metadata
        if name := package_metadata["Name"]:
            requirements = package_metadata.get_all("Requires-Dist") or []
            package_by_name.setdefault(canonicalize_name(name), (package_metadata["Version"], requirements))
    return package_by_name


def package_versions(names: Iterable[str] | None = None) -> dict[str, str | None]:
    """Return the version of each of these packages (default: all installed); None: not installed."""
    installed = _installed_packages()
    selected = installed if names is None else names
    return {name: installed.get(name, (None,))[0] for name in sorted(selected)}


def versions_of_fixed_packages() -> dict[str, str | None]:
    """Return the version of each installed package, without those installed as editable, whose code can
    change while their version stays.
    """
    editable = {*_editable_packages()}
    return {name: version for name, version in package_versions().items() if name not in editable}


@lru_cache(maxsize=1)
def _editable_packages() -> tuple[str, ...]:
    names = []
    for distribution in metadata.distributions():
        text = distribution.read_text("direct_url.json")
        with suppress(ValueError, AttributeError):  # damaged: as without the file
            if text and json.loads(text).get("dir_info", {}).get("editable"):
                names.append(canonicalize_name(distribution.metadata["Name"]))
    return tuple(names)


def required_packages() -> frozenset[str]:
    """Return the packages that mutator requires, directly or indirectly.

    If mutator is not installed, all installed packages are returned.
    """
    requirements = ((name, tuple(texts)) for name, (_, texts) in _installed_packages().items())
    return _required_of(tuple(requirements))


@lru_cache(maxsize=1)  # reading the requirements of all packages takes a tenth of a second
def _required_of(installed: tuple[tuple[str, tuple[str, ...]], ...]) -> frozenset[str]:
    """Return what mutator requires of the installed packages, each with its requirements."""
    requirements = dict(installed)
    visited: set[tuple[str, str]] = set()
    pending = [(DISTRIBUTION, "")]
    while pending:
        name, extra = pending.pop()
        if (name, extra) not in visited and name in requirements:
            visited.add((name, extra))
            for requirement in map(Requirement, requirements[name]):
                if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
                    required_name = canonicalize_name(requirement.name)
                    pending += [(required_name, extra_name) for extra_name in ("", *requirement.extras)]
    return frozenset(name for name, _ in visited) - {DISTRIBUTION} or frozenset(requirements)


def packages_of_modules(modules: Iterable[str]) -> tuple[str, ...]:
    """Return the packages that provide these top-level modules. Modules without a package are omitted."""
    providers = _packages_by_module()
    # the modules of an editable installation can be missing from `providers`; try the module's name
    names = (name for module in modules for name in providers.get(module, [module]))
    return tuple(sorted({canonicalize_name(name) for name in names} & _installed_packages().keys()))


def modules_without_package(modules: Iterable[str]) -> tuple[str, ...]:
    """Return the top-level modules that no package provides. No version tells what their code is."""
    return tuple(sorted(module for module in modules if not packages_of_modules([module])))


@lru_cache(maxsize=1)
def _packages_by_module() -> dict[str, list[str]]:
    """Return the packages of each top-level module; cached, because it reads every package's file list."""
    return dict(metadata.packages_distributions())
