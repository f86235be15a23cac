"""Targets with several packages and single-file modules, whose probe is a separate module."""

import shutil
from pathlib import Path

import pytest

from mutator.engines.engine_jobs import Job, RunMode
from mutator.model import Status
from mutator.triggers.trigger_kinds import trigger_at_time

from ..fork_on_toy import Edit, Fork

MANIFEST = "fault_library/targets/toycar.yaml"


@pytest.fixture
def several(fork: Fork, edit: Edit) -> Fork:
    """The toy with a sensor that imports a module outside any package."""
    tree = fork.toy.library.parent / "tree"
    (tree / "margin.py").write_text("def wider(gap):\n    gap = gap + 0.0\n    return gap\n")
    edit("tree/toycar/sensing.py", 'world."""\n', 'world."""\n\nimport margin\n')
    edit("tree/toycar/sensing.py", "gap = world.gap", "gap = margin.wider(world.gap)")
    edit(MANIFEST, "package: toycar", "packages: [toycar, margin.py]")
    edit(MANIFEST, '"toycar/**/*.py"', '"toycar/**/*.py", margin.py')
    return fork


def test_both_engines_give_the_same_bytes(several: Fork) -> None:
    job = several.job(trigger_at_time(2.0))
    assert {path for path in job.changed_files if path.endswith("_fi.py")} == {"_fi.py"}
    assert b"\nimport _fi  # fi:probe\n" in b"\n" + job.changed_files["toycar/sensing.py"]
    forked = several.engine.execute(job, several.folder / "work" / "forked")
    plain = several.engine.reference.execute(job, several.folder / "plain")
    assert (forked.status, forked.mode, forked.fallback_reason) == (Status.OK, RunMode.FORK, "")
    assert plain.status is Status.OK
    assert forked.probe_report == plain.probe_report is not None
    assert plain.probe_report["triggered"]
    for name in ("log.npz", "said.json"):
        assert (forked.out / name).read_bytes() == (plain.out / name).read_bytes()


def test_importing_a_target_module_from_another_folder_is_a_harness_error(
    several: Fork, tmp_path: Path
) -> None:
    _ = several.engine
    (tmp_path / "other").mkdir()
    shutil.copy(several.manifest.root / "margin.py", tmp_path / "other")
    body = f"import sys; sys.path.insert(0, {str(tmp_path / 'other')!r}); import margin"
    job = Job(
        name="elsewhere",
        scenario=several.toy.scenario("A"),
        seed=7,
        changed_files={"toycar/go.py": body.encode()},
    )
    found = several.engine.reference.execute(job, several.folder / "elsewhere")
    assert found.status is Status.HARNESS_ERROR
    assert "the target was also imported from" in found.detail and "margin.py" in found.detail
