"""Edits are noticed by content, in whatever way an editor writes a file."""

import os
from pathlib import Path

import pytest

from mutator.campaigns.source_edits import SourceEdits, describe_edits
from mutator.workspace import Workspace


@pytest.fixture
def edits(toycar: Workspace) -> SourceEdits:
    return SourceEdits(toycar, "toy")


@pytest.mark.parametrize(
    "name",
    [
        "fault_library/faults/sensor/distance.yaml",
        "fault_library/scenarios/A.yaml",
        "fault_library/campaigns/toy.yaml",
        "fault_library/targets/toycar.yaml",
        "templates/offset.py.j2",
        "tree/toycar/sensing.py",
    ],
)
def test_an_edit_of_what_a_campaign_is_made_from_is_noticed_once(
    toycar: Workspace, edits: SourceEdits, name: str
) -> None:
    """Specs, scenarios, campaigns, manifest, templates and target count, also if written by renaming."""
    path = toycar.library.parent / name
    new = path.with_name(f".{path.name}.new")
    new.write_bytes(path.read_bytes() + b"\n# edited\n")
    new.rename(path)
    assert edits.find() == (path,)
    assert edits.find() == ()


def test_what_editors_leave_beside_a_file_is_no_edit(toycar: Workspace, edits: SourceEdits) -> None:
    """Swap files, backups and bytecode are left out."""
    folder = toycar.library / "faults" / "sensor"
    for name in (".distance.yaml.swp", "distance.yaml~", "4913", "#distance.yaml#", "distance.yaml.tmp"):
        (folder / name).write_text("x")
    (toycar.library.parent / "tree" / "toycar" / "__pycache__").mkdir()
    assert edits.find() == ()


def test_a_file_written_with_the_same_content_is_no_edit(toycar: Workspace, edits: SourceEdits) -> None:
    """Saving without a change, as many editors do, counts for nothing."""
    path = toycar.library / "scenarios" / "A.yaml"
    path.write_bytes(path.read_bytes())
    os.utime(path, ns=(1, 1))
    assert edits.find() == ()


def test_new_and_deleted_files_are_edits(toycar: Workspace, edits: SourceEdits) -> None:
    """A new spec, a new module of the target and a deleted scenario count."""
    spec = toycar.library / "faults" / "other" / "new.yaml"
    spec.parent.mkdir()
    spec.write_text("schema: fault_spec/1\n")
    module = toycar.library.parent / "tree" / "toycar" / "new.py"
    module.write_text("A = 1\n")
    scenario = toycar.library / "scenarios" / "B.yaml"
    scenario.unlink()
    assert edits.find() == tuple(sorted((spec, module, scenario)))


def test_the_target_is_watched_while_the_manifest_cannot_be_read(
    toycar: Workspace, edits: SourceEdits
) -> None:
    """A mistake in the manifest hides no later edit of the target's files."""
    manifest, module = (
        toycar.library / "targets" / "toycar.yaml",
        toycar.library.parent / "tree/toycar/sensing.py",
    )
    manifest.write_text("no: [manifest")
    assert edits.find() == (manifest,)
    module.write_text(module.read_text() + "\nA = 1\n")
    assert edits.find() == (module,)


def test_edits_are_named_relative_to_the_folder() -> None:
    """Three names at most; the others are counted."""
    paths = [Path("/a/b"), Path("/c"), Path("/a/d/e"), Path("/a/f"), Path("/a/g")]
    assert describe_edits(paths, Path("/a")) == "b, /c, d/e and 2 more"
