"""The description of the machine in a run folder."""

from importlib import metadata
from pathlib import Path

import pytest

from mutator.campaigns import machine


def test_required_packages_include_indirect_requirements() -> None:
    found = machine.required()
    assert {"numpy", "jinja2", "markupsafe", "pydantic-core", "execnet", "pytest-xdist"} <= found
    assert not {"hypothesis", "mypy", "tox", "import-linter", "mutator"} & found


def test_requirements_that_do_not_apply_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    told = {
        "mutator": ("1", ["a[fast]>=1", "w; sys_platform == 'win32'", "t; extra == 'test'"]),
        "a": ("1", ["b", "c; extra == 'fast'", "d; extra == 'slow'", "gone"]),
        **{name: ("1", []) for name in "bcdtw"},
    }
    monkeypatch.setattr(machine, "_installed", lambda: told)
    assert machine.required() == {"a", "b", "c"}


def test_without_an_installed_mutator_every_package_is_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "_installed", lambda: {"numpy": ("1", []), "stranger": ("2", [])})
    assert machine.required() == {"numpy", "stranger"}


def test_versions_come_from_package_metadata() -> None:
    found = machine.versions(["numpy", "no-such-package"])
    assert found == {"numpy": metadata.version("numpy"), "no-such-package": None}


def test_modules_are_reported_by_package() -> None:
    assert machine.packages_of(["yaml", "_yaml", "cv2", "nosuch"]) == ("opencv-python-headless", "pyyaml")


def test_blas_uses_one_thread_in_any_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    machine.blas.cache_clear()
    (library,) = machine.blas()
    assert library.library and library.version and library.threads == 1
    assert set(machine.threads().values()) == {"1"} and "OPENBLAS_NUM_THREADS" in machine.threads()


def test_the_processor_model_is_read_from_cpuinfo() -> None:
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    models = {line.partition(":")[2].strip() for line in lines if line.startswith("model name")}
    assert not models or machine.cpu() in models
