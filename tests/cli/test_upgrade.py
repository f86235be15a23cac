"""`upgrade` rewrites manifests of the older schema."""

import json
import shutil
from dataclasses import fields
from pathlib import Path

import pytest
import yaml

from mutator.targets.manifest import TargetManifest
from mutator.targets.manifest_files import load_manifest

OLD = Path(__file__).parents[1] / "fixtures" / "run-2" / "toy"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    shutil.copytree(OLD, tmp_path / "toy")
    return tmp_path / "toy" / "fault_library" / "targets" / "toycar.yaml"


def changed(before: TargetManifest, after: TargetManifest) -> list[str]:
    same = [f.name for f in fields(before) if f.name != "source"]
    return [name for name in same if getattr(before, name) != getattr(after, name)]


def test_an_older_manifest_is_rewritten(cli, path: Path) -> None:
    text = path.read_text().replace("step_s:", "# of the world\nstep_s:")
    text = text.replace("compare:", "compare:  # pedals").replace("target/1\n", "target/1\n\n")
    path.write_text(text.replace("t: now\n", 't: "now  # b"\n'))
    before = load_manifest(path)
    answer = cli("upgrade", path)
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.splitlines()[1:] == ["  left out: # pedals"]
    assert changed(before, load_manifest(path)) == []
    kept = path.read_text()
    assert kept.startswith("schema: target/2\n\nname: toycar\n")
    assert "# of the world\nstep_s:" in kept
    assert "nothing to do" in cli("upgrade", path).out
    assert path.read_text() == kept


@pytest.mark.parametrize("indent", [None, 1])
def test_a_manifest_on_one_line_keeps_its_meaning(cli, path: Path, indent: int | None) -> None:
    path.write_text(json.dumps(yaml.safe_load(path.read_text()), indent=indent) + "  # all of it\n")
    before = load_manifest(path)
    answer = cli("upgrade", path)
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.splitlines()[1:] == ["  left out: # all of it"]
    assert path.read_text().startswith("schema: target/2\n")
    assert changed(before, load_manifest(path)) == []


def test_a_compared_and_plotted_channel_becomes_an_actuator(cli, path: Path) -> None:
    path.write_text(path.read_text().replace("plot:\n", 'plot:\n  gas: {unit: "%"}\n'))
    loaded = load_manifest(path)
    assert cli("upgrade", path).code == 0
    for manifest in (loaded, load_manifest(path)):
        assert next((c.name, c.unit) for c in manifest.compared) == ("gas", "-")


def test_line_endings_and_links_are_preserved(cli, path: Path) -> None:
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    link = path.with_name("link.yaml")
    link.symlink_to(path.name)
    assert cli("upgrade", link).code == 0
    assert link.is_symlink()
    data = path.read_bytes()
    assert data.startswith(b"schema: target/2\r\n")
    assert data.count(b"\n") == data.count(b"\r\n")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("time_channel: time\n", "no `time_channel`\n  expected: this key in a manifest of target/1"),
        ("record_file: said.json\n", "no `record_file`"),
        ("  v_lead: world.lead_speed\n", "toycar.yaml:30: no `v_lead`"),
        ("    alone: [--alone]\n", "toycar.yaml:13"),  # a mapping without entries
        ("name: toycar\n", "name"),
    ],
)
def test_a_manifest_that_cannot_be_loaded_is_not_rewritten(cli, path: Path, line: str, message: str) -> None:
    path.write_text(path.read_text().replace(line, ""))
    before = path.read_bytes()
    answer = cli("upgrade", path)
    assert answer.code == 2
    assert message in answer.err
    assert path.read_bytes() == before


def test_a_manifest_with_an_invalid_value_is_not_rewritten(cli, path: Path) -> None:
    """Formulas and placeholders are checked in the form in which they will be used."""
    path.write_text(path.read_text().replace('"{out}", --number', '"{oot}", --number'))
    before = path.read_bytes()
    assert "{oot}" in cli("upgrade", path).err
    assert path.read_bytes() == before


def test_a_file_of_another_kind_is_refused(cli, tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text("schema: campaign/1\n")
    answer = cli("upgrade", path)
    assert answer.code == 2
    assert "campaign/1" in answer.err
    assert path.read_text() == "schema: campaign/1\n"
