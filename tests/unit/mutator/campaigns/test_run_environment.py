"""The description of the machine in a run folder."""

from importlib import metadata
from pathlib import Path

import pytest

from mutator._common.version import DISTRIBUTION
from mutator.campaigns import run_environment


def test_required_packages_include_indirect_requirements() -> None:
    found = run_environment.required_packages()
    assert {"numpy", "jinja2", "markupsafe", "pydantic-core", "execnet", "pytest-xdist"} <= found
    assert not {"hypothesis", "mypy", "tox", "import-linter", DISTRIBUTION} & found


def test_requirements_that_do_not_apply_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    told = {
        DISTRIBUTION: ("1", ["a[fast]>=1", "w; sys_platform == 'win32'", "t; extra == 'test'"]),
        "a": ("1", ["b", "c; extra == 'fast'", "d; extra == 'slow'", "gone"]),
        **{name: ("1", []) for name in "bcdtw"},
    }
    monkeypatch.setattr(run_environment, "_installed_packages", lambda: told)
    assert run_environment.required_packages() == {"a", "b", "c"}


def test_without_an_installed_mutator_every_package_is_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        run_environment, "_installed_packages", lambda: {"numpy": ("1", []), "stranger": ("2", [])}
    )
    assert run_environment.required_packages() == {"numpy", "stranger"}


def test_versions_come_from_package_metadata() -> None:
    found = run_environment.package_versions(["numpy", "no-such-package"])
    assert found == {"numpy": metadata.version("numpy"), "no-such-package": None}


def test_modules_are_reported_by_package() -> None:
    assert run_environment.packages_of_modules(["yaml", "_yaml", "cv2", "nosuch"]) == (
        "opencv-python-headless",
        "pyyaml",
    )


def test_blas_uses_one_thread_in_any_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    run_environment.loaded_blas.cache_clear()
    (library,) = run_environment.loaded_blas()
    assert library.library and library.version and library.threads == 1
    assert (
        set(run_environment.thread_limits().values()) == {"1"}
        and "OPENBLAS_NUM_THREADS" in run_environment.thread_limits()
    )


def test_the_processor_model_is_read_from_cpuinfo() -> None:
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    models = {line.partition(":")[2].strip() for line in lines if line.startswith("model name")}
    assert not models or run_environment.processor_name() in models
