"""The packages that a target needs."""

from importlib import metadata
from pathlib import Path

import pytest

import mutator
from mutator.api.trials import try_fault
from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.campaigns.run_provenance import accepted_version_differences, begin_session_environment
from mutator.checks.check_findings import CheckState
from mutator.checks.library_check import library_problems
from mutator.checks.machine_check import examine_machine
from mutator.errors import MutatorError
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

MESSAGE = (
    r"toycar.yaml:3: no-such-thing: not installed; numpy: \S+, wanted >=999; expected the packages that "
    r"target toycar requires; pip install 'no-such-thing==1.0' 'numpy>=999'"
)


def requiring(workspace: Workspace, *requirements: str) -> Workspace:
    path = workspace.library / "targets" / "toycar.yaml"
    head, about, rest = path.read_text().split("\n", 2)
    path.write_text(f"{head}\n{about}\nrequires: {list(requirements)}\n{rest}")
    return workspace


@pytest.fixture
def toycar_without_packages(toycar: Workspace) -> Workspace:
    wanted = ("no-such-thing==1.0", "numpy>=999", "pyyaml", "none; python_version < '3'")
    return requiring(toycar, *wanted)


def test_missing_packages_are_reported_before_anything_runs(
    toycar_without_packages: Workspace, tmp_path: Path
) -> None:
    with pytest.raises(MutatorError, match=MESSAGE):
        try_fault("sensor/lane", "A", 1.0, workspace=toycar_without_packages)
    with pytest.raises(MutatorError, match=MESSAGE):
        mutator.run("small", out=tmp_path / "run", workspace=toycar_without_packages)
    assert not (tmp_path / "run" / "checks.json").exists()


def test_check_and_doctor_report_a_missing_package(toycar_without_packages: Workspace) -> None:
    problem, *_ = library_problems(toycar_without_packages, "toycar")
    with pytest.raises(MutatorError, match=MESSAGE):
        raise problem
    (found,) = [
        finding for finding in examine_machine(toycar_without_packages) if finding.name == "target toycar"
    ]
    assert found.level is CheckState.FAIL
    assert found.remedy == "pip install 'no-such-thing==1.0' 'numpy>=999'"


def test_an_invalid_requirement_is_refused_at_its_line(toycar: Workspace) -> None:
    requiring(toycar, "numpy >> 2")
    with pytest.raises(MutatorError, match=r"toycar.yaml:3: 'numpy >> 2'; expected a requirement in pip"):
        toycar.manifest("toycar")


def test_versions_are_stored_with_a_stretch_of_work(toycar: Workspace, tmp_path: Path) -> None:
    """The versions of all required packages are stored, whether or not a run uses them."""
    requiring(toycar, "HypoThesis>=6")
    folder = freeze_plan(build_plan(toycar, "small"), tmp_path / "run", toycar)
    begin_session_environment(folder, toycar, records_glob="0001-*", accept_versions=False)
    (stretch,) = RunFolder.open(folder.path).session_environments
    assert stretch.packages["hypothesis"] == metadata.version("hypothesis")
    assert accepted_version_differences(RunFolder.open(folder.path)) == ()
