"""Targets are found by the `name` in their manifests."""

from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.targets.manifests_by_name import manifest_path_by_name
from mutator.workspace import Workspace


def rename(toycar: Workspace, new_file: str, name: str) -> Path:
    """Write a second manifest: a copy of toycar's under another file and name."""
    text = (toycar.library / "targets" / "toycar.yaml").read_text()
    path = toycar.library / "targets" / f"{new_file}.yaml"
    path.write_text(text.replace("name: toycar", f"name: {name}", 1))
    return path


def test_a_target_is_found_by_its_name_whatever_its_file_is_called(toycar: Workspace) -> None:
    """The reference says that campaigns use the name."""
    path = rename(toycar, "file", "mass")
    assert toycar.targets["mass"] == path
    assert toycar.manifest("mass").name == "mass"
    with pytest.raises(
        MutatorError, match=r"no target 'file'.*one of mass, toycar.*file.yaml describes 'mass'"
    ):
        toycar.manifest("file")


def test_two_manifests_of_one_name_are_refused_with_both_files(toycar: Workspace) -> None:
    """Otherwise the order of files would choose the target."""
    rename(toycar, "again", "toycar")
    with pytest.raises(MutatorError, match=r"toycar.yaml:2: target 'toycar', .* name in again.yaml"):
        toycar.manifest("toycar")


def test_a_damaged_manifest_does_not_hide_the_others(toycar: Workspace) -> None:
    """It has the name of its file, so that loading it reports the mistake."""
    damaged = toycar.library / "targets" / "damaged.yaml"
    damaged.write_text("schema: [")
    assert toycar.manifest("toycar").name == "toycar"
    with pytest.raises(MutatorError, match=r"damaged.yaml:\d+: not valid YAML"):
        toycar.manifest("damaged")


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("name: plain\nroot: [", "plain"),
        ("root: .\n\nname: plain\nabout: x\n", "plain"),
        ("name: two\n  lines\n", "two lines"),
        ("name: >-\n  folded\n", "folded"),
        ('name: "quoted"\r\n', "quoted"),
        ("{name: flow}", "flow"),
        ("about: |\n  name: inner\nname: outer\n", "outer"),
        ("about: 'a\nname: inner'\nname: outer\n", "outer"),
        ("name: true\n", "file"),
        ("name: on\n", "on"),
        ("name: 12\n", "file"),
        ("names: [x]\n", "file"),
        ("name: ../up\n", "file"),
        ("name: a\nname: b\n", "file"),
    ],
)
def test_a_name_is_what_yaml_says_although_mostly_one_line_is_read(
    tmp_path: Path, text: str, name: str
) -> None:
    path = tmp_path / "file.yaml"
    path.write_bytes(text.encode())
    assert manifest_path_by_name({"file": path}) == {name: path}
