"""Overlays: glue in the library that is added to a foreign tree."""

import shutil
from pathlib import Path

import pytest

from mutator.api.trials import try_fault
from mutator.checks.machine_check import examine_machine
from mutator.errors import MutatorError
from mutator.faults.spec_expansion import expand_spec
from mutator.model import Outcome
from mutator.mutants.mutant_building import build
from mutator.report.experiment_filming import Shot, _write_shots
from mutator.triggers.trigger_kinds import always_trigger
from mutator.workspace import Workspace

MANIFEST = "targets/pole.yaml"


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_an_overlay_is_part_of_the_tree(pole: Workspace) -> None:
    """A run must import the overlay's modules from the tree."""
    before = pole.manifest("pole")
    assert before.tree.overlaid_paths == {"drive.py", "glue_parts/scenario.py"}
    assert before.overlay == (pole.library / "overlays" / "pole").resolve()
    assert set(before.import_names) == {"pole", "regulator", "filters", "drive", "glue_parts"}
    overlay = pole.library / "overlays" / "pole"
    (overlay / "gains.txt").write_text("1")
    (overlay / "__pycache__").mkdir()
    (overlay / "__pycache__" / "drive.pyc").write_text("x")
    after = pole.manifest("pole").tree
    assert after.files["gains.txt"] == b"1"
    assert set(after.overlaid_paths) == {*before.tree.overlaid_paths, "gains.txt"}
    assert after.digest != before.tree.digest
    assert not (before.root / "drive.py").exists()


def test_an_overlay_is_also_looked_up_in_the_library(pole: Workspace) -> None:
    edit(pole.library / MANIFEST, "../overlays/pole", "overlays/pole")
    assert "drive.py" in pole.manifest("pole").tree.overlaid_paths
    edit(pole.library / MANIFEST, "overlays/pole", "overlays/none")
    with pytest.raises(MutatorError, match=r"pole.yaml:5: no folder .*expected a folder of glue"):
        pole.manifest("pole")


def test_faults_in_a_tree_with_an_overlay_take_effect(pole: Workspace) -> None:
    trial = try_fault("sensor/angle", "tilted", 1.0, value=60, workspace=pole)
    assert trial.record.outcome is Outcome.HAZARD
    assert trial.record.activation is not None and trial.record.activation.first == 1.0
    trial = try_fault("filter/memory", "tilted", 1.0, workspace=pole)
    assert trial.record.outcome is Outcome.HAZARD


def test_no_fault_can_be_injected_into_an_overlay(pole: Workspace) -> None:
    spec = pole.library / "faults" / "sensor" / "angle.yaml"
    edit(
        spec,
        "file: regulator.py, function: Regulator.torque, after_assign: estimate",
        "file: drive.py, function: Run.step, after_assign: torque",
    )
    with pytest.raises(
        MutatorError, match=r"angle.yaml:\d+: file 'drive.py' is in the overlay of target pole"
    ):
        expand_spec(pole.spec("sensor/angle"), 0, models=pole.fault_models(), manifest=pole.manifest("pole"))


@pytest.mark.parametrize("name", ["regulator.py", "filters/low_pass.py", "notes.txt"])
def test_a_file_of_both_overlay_and_root_is_refused(pole: Workspace, name: str) -> None:
    (pole.manifest("pole").root / "notes.txt").write_text("mine")
    path = pole.library / "overlays" / "pole" / name
    path.parent.mkdir(exist_ok=True)
    path.write_text("x = 1\n")
    with pytest.raises(MutatorError, match=rf"'{name}' is in the overlay and in .*tree; .*rename"):
        _ = pole.manifest("pole").tree


def test_an_overlay_cannot_have_the_probes_name(pole: Workspace) -> None:
    (pole.library / "overlays" / "pole" / "_fi.py").write_text("x = 1\n")
    with pytest.raises(MutatorError, match=r"the target has a file _fi.py; expected no file of this name"):
        build(pole.manifest("pole"), pole.fault_models(), None, always_trigger())


def test_a_linked_overlay_works_like_the_original(pole: Workspace) -> None:
    whole = pole.manifest("pole").tree
    overlay, elsewhere = pole.library / "overlays" / "pole", pole.library / "overlays" / "common"
    shutil.move(overlay / "glue_parts", elsewhere / "glue_parts")
    shutil.move(overlay / "drive.py", elsewhere / "drive.py")
    for name in ("drive.py", "glue_parts"):
        (overlay / name).symlink_to(elsewhere / name)
    assert pole.manifest("pole").tree.digest == whole.digest
    assert try_fault("sensor/angle", "tilted", 1.0, workspace=pole).record.activation is not None
    shutil.rmtree(overlay)
    overlay.symlink_to(elsewhere)
    assert pole.manifest("pole").tree.digest == whole.digest


def test_a_link_out_of_the_library_is_refused(pole: Workspace, tmp_path: Path) -> None:
    overlay, mine = pole.library / "overlays" / "pole", tmp_path / "mine"
    mine.mkdir()
    (mine / "notes.txt").write_text("secret")
    (overlay / "data").symlink_to(mine)
    with pytest.raises(MutatorError, match=r"overlays/pole/data: a link that leads out of its folder"):
        _ = pole.manifest("pole").tree
    shutil.rmtree(overlay)
    overlay.symlink_to(mine)
    with pytest.raises(MutatorError, match=r"pole\.yaml:5: '\.\./overlays/pole' leads out of the library"):
        pole.manifest("pole")


def test_errors_name_the_file_of_the_overlay(pole: Workspace) -> None:
    overlay = (pole.library / "overlays" / "pole").resolve()
    edit(pole.library / MANIFEST, "after_assign: now", "after_assign: then")
    with pytest.raises(MutatorError) as caught:
        build(pole.manifest("pole"), pole.fault_models(), None, always_trigger())
    assert caught.value.where == str(overlay / "drive.py")
    assert pole.manifest("pole").tree.path_as_in_specs(caught.value.where) == "drive.py"
    (found,) = [finding for finding in examine_machine(pole) if finding.name == "target pole"]
    assert f"{pole.manifest('pole').root} and {overlay}: 6 files" in found.found


def test_the_film_command_has_the_overlay_and_the_root_in_one_folder(pole: Workspace, tmp_path: Path) -> None:
    body = "import sys, drive, pole; open(sys.argv[1], 'w').write(drive.__file__)"
    (pole.library / "overlays" / "pole" / "show.py").write_text(body)
    film = 'film: {run: [], module: show, args: ["{out}"], still: []}\n'
    manifest = pole.library / MANIFEST
    manifest.write_text(manifest.read_text() + film)
    shot = Shot(path=tmp_path / "out.txt")
    films = dict.fromkeys(("golden", "faulty"), str(tmp_path))
    _write_shots(pole.manifest("pole"), tmp_path / "scratch", films, [shot])
    assert shot.path.read_text() == str(tmp_path / "scratch" / "tree" / "drive.py")
