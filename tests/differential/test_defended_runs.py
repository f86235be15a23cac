"""Each set of defences has a run of its own, and the undefended run is as without them."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.execution.campaign_running import run_campaign
from mutator.model import Outcome
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

from .command import Bytes, results

CopyToycar = Callable[[Path], Workspace]
SETS = ("emergency_brake", "pedal_limit+emergency_brake")
KEY = "defences: [none, emergency_brake, [pedal_limit, emergency_brake]]\n"


def results_of_all(run: Path) -> dict[str, Bytes]:
    """Return what each set gave, and as `""` what the run without defences did."""
    goldens = {path.name: path.read_bytes() for path in (run / "golden").rglob("*.npz")}
    return {"": results(run) | goldens} | {name: results(run / "defended" / name) for name in SETS}


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory, copy_toycar: CopyToycar) -> tuple[Workspace, Path]:
    """The defended campaign, run in one process. Tests must not write to its folder."""
    folder = tmp_path_factory.mktemp("defended")
    workspace = copy_toycar(folder)
    summary = run_campaign(workspace, "defended", folder / "run")
    assert summary.exit_code == 0
    assert [*summary.defended] == [*SETS]
    return workspace, folder / "run"


def test_a_defence_prevents_what_it_is_for(places: tuple[Workspace, Path]) -> None:
    """The emergency brake stops collisions, and its record says how; it does nothing about lanes."""
    run = places[1]
    undefended, defended = (RunFolder.open(path).records() for path in (run, run / "defended" / SETS[0]))
    collided = {name for name, record in undefended.items() if "H1" in dict(record.hazards)}
    assert collided
    for name in collided:
        (brake,) = defended[name].defences
        assert "H1" not in dict(defended[name].hazards)
        assert (brake.name, brake.steps >= brake.activations > 0) == ("emergency_brake", True)
        assert {command for command, _, _ in brake.commands} <= {"gas", "brake"}
    in_lane = {name for name, record in undefended.items() if "H3" in dict(record.hazards)}
    assert in_lane and all("H3" in dict(defended[name].hazards) for name in in_lane)
    assert all(not record.defences for record in undefended.values())


def test_a_set_has_its_own_checks_and_no_canary(places: tuple[Workspace, Path]) -> None:
    """Its golden runs are those of the defended tree, and what the defences did in them is kept."""
    folder = RunFolder.open(places[1] / "defended" / SETS[1])
    checks = json.loads((folder.path / "checks.json").read_text())
    assert [result["name"] for result in checks["results"]] == ["anchors", "golden A", "null mutant A"]
    report = json.loads((folder.golden_folder("A") / "defences.json").read_text())
    assert report["pedal_limit"]["steps"] > 0 == report["emergency_brake"]["steps"]
    undefended = RunFolder.open(places[1])
    assert folder.head.plan == undefended.head.plan
    assert folder.head.sources["target"] != undefended.head.sources["target"]
    assert [defence.name for defence in folder.head.defences] == ["pedal_limit", "emergency_brake"]


def test_the_undefended_run_is_as_without_the_key(
    places: tuple[Workspace, Path], copy_toycar: CopyToycar, tmp_path: Path
) -> None:
    """All but the campaign's text is the same to the byte: records, golden runs, proof and tables."""
    workspace = copy_toycar(tmp_path)
    path = workspace.campaign("defended")
    path.write_text(path.read_text().replace(KEY, ""))
    run = tmp_path / "run"
    assert run_campaign(workspace, "defended", run).exit_code == 0
    assert not (run / "defended").exists()
    for kind in ("records", "proof"):
        assert RunFolder.open(run).records(kind) == RunFolder.open(places[1]).records(kind)
    assert results(run) == results(places[1])
    heads = [json.loads((path / "run.json").read_text()) for path in (run, places[1])]
    assert {key for key in heads[0] if heads[0][key] != heads[1][key]} <= {"campaign_digest", "stretches"}
    assert heads[0].keys() == heads[1].keys()


@pytest.mark.parametrize("more", [{"workers": 2}, {"engine": "reference"}], ids=["workers", "reference"])
def test_workers_and_engine_change_no_byte(
    places: tuple[Workspace, Path], tmp_path: Path, more: dict[str, object]
) -> None:
    summary = run_campaign(places[0], "defended", tmp_path / "run", reuse=False, **more)  # type: ignore[arg-type]
    assert summary.exit_code == 0
    assert results_of_all(tmp_path / "run") == results_of_all(places[1])


def test_a_finished_campaign_runs_nothing_again(places: tuple[Workspace, Path]) -> None:
    before = results_of_all(places[1])
    summary = run_campaign(places[0], "defended", places[1])
    assert [summary.ran, *(one.ran for one in summary.defended.values())] == [0, 0, 0]
    assert results_of_all(places[1]) == before


def test_an_audit_covers_each_set(places: tuple[Workspace, Path]) -> None:
    """It finds no difference, and tells the seals of the sets."""
    audit = mutator.verify(places[1], workspace=places[0])
    assert audit.passed, str(audit)
    assert {f"defended/{name}, seal" for name in SETS} <= audit.facts.keys()
    counts = {check.checked_parts: check.checked_count for check in audit.checks}
    assert {counts[f"defended/{name}"] for name in SETS} == {RunFolder.open(places[1]).head.experiments}


def test_an_audit_finds_what_was_changed_in_a_set(
    places: tuple[Workspace, Path], copy_toycar: CopyToycar, tmp_path: Path
) -> None:
    run = shutil.copytree(places[1], tmp_path / "run")
    golden = next((run / "defended" / SETS[0] / "golden").rglob("defences.json"))
    golden.write_text(golden.read_text().replace("null", "1.0", 1))
    audit = mutator.verify(run, workspace=places[0])
    assert not audit.passed
    assert "defences.json" in str(audit)


def test_the_library_must_stay_the_same(
    places: tuple[Workspace, Path], copy_toycar: CopyToycar, tmp_path: Path
) -> None:
    """A set whose defence was edited is not continued."""
    workspace = copy_toycar(tmp_path)
    run = tmp_path / "run"
    assert run_campaign(workspace, "defended", run).exit_code == 0
    path = workspace.defences["emergency_brake"]
    path.write_text(path.read_text().replace("value: 1.5", "value: 1.6"))
    with pytest.raises(MutatorError, match=r"sources changed .* defence emergency_brake"):
        run_campaign(workspace, "defended", run)


def test_outcomes_of_both_runs_can_be_compared(places: tuple[Workspace, Path]) -> None:
    """Records are paired by id."""
    runs = [RunFolder.open(path).records() for path in (places[1], places[1] / "defended" / SETS[0])]
    assert runs[0].keys() == runs[1].keys()
    outcomes = [[record.outcome for record in records.values()] for records in runs]
    assert outcomes[0].count(Outcome.HAZARD) > outcomes[1].count(Outcome.HAZARD)
