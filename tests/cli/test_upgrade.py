"""`mutator upgrade`: manifests of the older schema."""

import shutil
from dataclasses import fields
from pathlib import Path

from mutator.targets.manifest_files import load_manifest

OLD = Path(__file__).parents[1] / "fixtures" / "run-2" / "toy"


def test_an_older_manifest_is_written_anew(cli, tmp_path: Path) -> None:
    """It says the same as before, comments elsewhere stay, and those that could not are printed."""
    shutil.copytree(OLD, tmp_path / "toy")
    path = tmp_path / "toy" / "fault_library" / "targets" / "toycar.yaml"
    text = (
        path.read_text()
        .replace("step_s:", "# of the world\nstep_s:")
        .replace("compare:", "compare:  # pedals")
    )
    path.write_text(text)
    before = load_manifest(path)
    answer = cli("upgrade", path)
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.splitlines()[1:] == ["  left out: # pedals"]
    after = load_manifest(path)
    same = [f.name for f in fields(before) if f.name != "source"]
    assert [name for name in same if getattr(before, name) != getattr(after, name)] == []
    kept = path.read_text()
    assert kept.startswith("schema: target/2\n")
    assert "# of the world\nstep_s:" in kept
    assert "nothing to do" in cli("upgrade", path).out
    assert path.read_text() == kept


def test_what_is_no_manifest_is_left_alone(cli, tmp_path: Path) -> None:
    """A file of another kind is a user's error, and stays as it is."""
    path = tmp_path / "x.yaml"
    path.write_text("schema: campaign/1\n")
    answer = cli("upgrade", path)
    assert answer.code == 2
    assert "campaign/1" in answer.err
    assert path.read_text() == "schema: campaign/1\n"
