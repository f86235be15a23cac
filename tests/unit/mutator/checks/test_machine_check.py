"""The check of the machine by `doctor`."""

import importlib.metadata
from pathlib import Path

import pytest

from mutator.checks import machine_check
from mutator.checks.machine_check import CheckState
from mutator.errors import MutatorError

NO_LIBRARY = MutatorError("no fault library", remedy="say --root")


def test_on_this_machine_only_the_library_fails() -> None:
    findings = machine_check.examine_machine(NO_LIBRARY)
    failed = [f for f in findings if f.level is CheckState.FAIL]
    assert [(f.name, f.found, f.remedy) for f in failed] == [("library", "no fault library", "say --root")]
    assert {"python", "numpy", "cores", "child process"} <= {f.name for f in findings}


def test_an_old_python_fails_with_the_tested_versions(monkeypatch: pytest.MonkeyPatch) -> None:
    """The remedy names the versions that README and the limits name."""
    monkeypatch.setattr(machine_check, "OLDEST_PYTHON", (99, 0))
    [finding] = [f for f in machine_check.examine_machine(NO_LIBRARY) if f.name == "python"]
    assert (finding.level, finding.remedy) == (CheckState.FAIL, "use Python 3.11 to 3.14")


def test_a_missing_package_fails_with_its_pip_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.metadata, "requires", lambda _: ["no-such-package>=2,<3"])
    [finding] = [f for f in machine_check.examine_machine(NO_LIBRARY) if f.name == "no-such-package"]
    assert finding.level is CheckState.FAIL
    assert finding.remedy == "pip install 'no-such-package<3,>=2'"


def test_a_harness_that_pip_did_not_install_is_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    """It runs from the clone, but its requirements and the additions of other packages are unknown."""
    monkeypatch.setattr(machine_check, "DISTRIBUTION", "no-such-mutator")
    [finding] = [f for f in machine_check.examine_machine(NO_LIBRARY) if f.name == "no-such-mutator"]
    assert (finding.level, finding.found) == (CheckState.WARN, "not installed")
    assert "pip install" in finding.remedy


def test_a_distribution_with_the_earlier_name_is_a_warning(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Both would write the package `mutator`."""
    assert "mutator" not in {f.name for f in machine_check.examine_machine(NO_LIBRARY)}
    info = tmp_path / "mutator-0.1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mutator\nVersion: 0.1.0\n")
    monkeypatch.syspath_prepend(tmp_path)
    [finding] = [f for f in machine_check.examine_machine(NO_LIBRARY) if f.name == "mutator"]
    assert finding.level is CheckState.WARN and finding.found.startswith("0.1.0 is installed, too")
    assert "`pip uninstall mutator mutator-fi`" in finding.remedy


def test_another_version_is_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    """The package might still work."""
    monkeypatch.setattr(importlib.metadata, "requires", lambda _: ["numpy>=999"])
    [finding] = [f for f in machine_check.examine_machine(NO_LIBRARY) if f.name == "numpy"]
    assert finding.level is CheckState.WARN
    assert finding.found.endswith("wanted >=999")


def test_a_folder_without_locks_is_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(machine_check.fcntl, "flock", refuse)
    [finding] = [f for f in machine_check.examine_machine(NO_LIBRARY) if f.name == "folder"]
    assert (finding.level, finding.found.rpartition(": ")[2]) == (CheckState.WARN, "Operation not supported")
    assert "--out" in finding.remedy


def test_a_child_process_that_cannot_start_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_check.sys, "executable", "/no/such/python")
    [finding] = [f for f in machine_check.examine_machine(NO_LIBRARY) if f.name == "child process"]
    assert finding.level is CheckState.FAIL
