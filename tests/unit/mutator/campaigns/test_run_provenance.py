"""What a session records about itself in run.json, and when a session is refused."""

import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pytest

from mutator.campaigns import run_environment
from mutator.campaigns.git_clone import find_clone_state
from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.campaigns.run_provenance import accepted_version_differences, begin_session_environment
from mutator.errors import EXIT_WRONG_INPUT, MutatorError
from mutator.execution.distributor_choice import choose_distributor, packages_of_distributor
from mutator.store.checks_file import CHECKS_SCHEMA
from mutator.store.run_folder import RunFolder
from mutator.store.session_environments import GitCloneState
from mutator.workspace import Workspace


@pytest.fixture
def folder(toycar: Workspace, tmp_path: Path) -> RunFolder:
    """A planned run whose checks list `iniconfig` and `hypothesis` as packages that golden runs loaded."""
    planned = freeze_plan(build_plan(toycar, "small"), tmp_path / "run", toycar)
    said = {"schema": CHECKS_SCHEMA, "packages": ["hypothesis", "iniconfig"]}
    (planned.path / "checks.json").write_text(json.dumps(said))
    return planned


def use(monkeypatch: pytest.MonkeyPatch, **other: str | None) -> None:
    """Replace the versions of some packages; None means not installed."""
    real = run_environment.package_versions

    def versions(names: Iterable[str] | None = None) -> dict[str, str | None]:
        found = real(names)
        return found | {name: version for name, version in other.items() if name in found}

    monkeypatch.setattr(run_environment, "package_versions", versions)


def test_a_session_records_everything_that_affects_results(folder: RunFolder, toycar: Workspace) -> None:
    folder = begin_session_environment(folder, toycar, records_glob="0001-*", accept_versions=False)
    (stretch,) = RunFolder.open(folder.path).session_environments
    assert stretch == folder.session_environments[0]
    assert (
        stretch.python == run_environment.python_version() and stretch.cpu == run_environment.processor_name()
    )
    assert stretch.packages == run_environment.package_versions(
        {*run_environment.required_packages(), "hypothesis"}
    )
    assert (stretch.records, stretch.git, stretch.accepted) == ("0001-*", _clone(), ())
    assert stretch.blas and stretch.threads and stretch.platform


def _clone() -> dict[str, GitCloneState] | None:
    """Return the git state of the harness; the toy is outside any clone."""
    state = find_clone_state(Path(run_environment.__file__).parents[1])
    return {"mutator": state} if state else None


def test_a_later_session_only_appends_to_run_json(folder: RunFolder, toycar: Workspace) -> None:
    before = json.loads((folder.path / "run.json").read_text())
    for session in ("0001-*", "0002-*"):
        begin_session_environment(
            RunFolder.open(folder.path), toycar, records_glob=session, accept_versions=False
        )
    after = json.loads((folder.path / "run.json").read_text())
    assert [stretch["records"] for stretch in after.pop("stretches")] == ["0001-*", "0002-*"]
    assert before.pop("stretches") == [] and before == after


def test_a_package_that_reads_the_traces_or_distributes_the_work_is_recorded(
    folder: RunFolder, toycar: Workspace, door_examples: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for cached in (run_environment._installed_packages, run_environment._packages_by_module):
        monkeypatch.setattr(run_environment, cached.__name__, cached.__wrapped__)
    manifest = toycar.manifest("toycar")
    plain = begin_session_environment(
        folder, toycar, records_glob="0001-*", accept_versions=False
    ).session_environments[-1]
    assert "door-examples" not in plain.packages
    packages = packages_of_distributor(choose_distributor("here:"))
    spread = begin_session_environment(
        folder, toycar, records_glob="0001-*", accept_versions=False, packages=packages
    )
    monkeypatch.setattr(type(toycar), "manifest", lambda *_: replace(manifest, trace_file="log.jsonl"))
    reading = begin_session_environment(folder, toycar, records_glob="0001-*", accept_versions=False)
    for begun in (spread, reading):
        assert begun.session_environments[-1].packages == {**plain.packages, "door-examples": "1.0"}
    use(monkeypatch, **{"door-examples": "1.1"})
    with pytest.raises(MutatorError, match=r"door-examples 1\.0, here 1\.1"):
        accepted_version_differences(reading)


def test_before_the_first_run_any_version_is_accepted(
    folder: RunFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    use(monkeypatch, numpy="2.1.0")
    assert accepted_version_differences(folder) == ()


@pytest.mark.parametrize(
    ("other", "told"),
    [
        ({"jinja2": "9.0"}, f"jinja2 {run_environment.package_versions(['jinja2'])['jinja2']}, here 9.0"),
        (
            {"hypothesis": "9.0"},
            f"hypothesis {run_environment.package_versions(['hypothesis'])['hypothesis']}, here 9.0",
        ),
        (
            {"iniconfig": None},
            f"iniconfig {run_environment.package_versions(['iniconfig'])['iniconfig']}, here none",
        ),
    ],
    ids=["of the harness", "of the target", "gone"],
)
def test_different_versions_are_refused_unless_accepted(
    folder: RunFolder,
    toycar: Workspace,
    monkeypatch: pytest.MonkeyPatch,
    other: dict[str, str | None],
    told: str,
) -> None:
    folder = begin_session_environment(folder, toycar, records_glob="0001-*", accept_versions=False)
    use(monkeypatch, **other)
    with pytest.raises(MutatorError) as caught:
        accepted_version_differences(folder)
    assert caught.value.exit_code == EXIT_WRONG_INPUT
    assert caught.value.got == f"this run used other versions: {told}"
    folder = begin_session_environment(folder, toycar, records_glob="0002-*", accept_versions=True)
    assert [list(stretch.accepted) for stretch in folder.session_environments] == [[], [told]]
    assert accepted_version_differences(folder) == ()  # from now on, these are the run's versions


def test_another_python_version_is_refused(
    folder: RunFolder, toycar: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("platform.python_version", lambda: "3.11.7")
    folder = begin_session_environment(folder, toycar, records_glob="0001-*", accept_versions=False)
    monkeypatch.setattr("platform.python_version", lambda: "3.12.1")
    with pytest.raises(MutatorError, match=r"CPython 3\.11\.7, here CPython 3\.12\.1"):
        accepted_version_differences(folder)


@pytest.mark.parametrize("changed", ["cpu", "platform", "threads"])
def test_another_machine_is_recorded_but_not_refused(
    folder: RunFolder, toycar: Workspace, monkeypatch: pytest.MonkeyPatch, changed: str
) -> None:
    """Golden runs show whether two machines compute the same results."""
    folder = begin_session_environment(folder, toycar, records_glob="0001-*", accept_versions=False)
    other = {"threads": {"OMP_NUM_THREADS": "8"}}.get(changed, "another")
    name = {
        "cpu": "mutator.campaigns.run_environment.processor_name",
        "platform": "platform.platform",
        "threads": "mutator.campaigns.run_environment.thread_limits",
    }[changed]
    monkeypatch.setattr(name, lambda: other)
    assert accepted_version_differences(folder) == ()
    folder = begin_session_environment(folder, toycar, records_glob="0002-*", accept_versions=False)
    assert (
        getattr(folder.session_environments[1], changed)
        == other
        != getattr(folder.session_environments[0], changed)
    )
