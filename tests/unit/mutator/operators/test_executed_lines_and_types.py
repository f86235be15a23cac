"""The lines that a golden run executes."""

from pathlib import Path

import pytest

from mutator._common import cache_layout_and_pruning
from mutator.engines.engine_jobs import Job
from mutator.engines.reference_engine import ReferenceEngine
from mutator.errors import MutatorError
from mutator.limits import Limits
from mutator.model import Status
from mutator.operators import executed_lines_and_types
from mutator.operators.executed_lines_and_types import (
    GoldenRunInputs,
    measure_executed_lines,
    measure_variable_types,
)
from mutator.workspace import Workspace

LIMITS = Limits(cpu_s=20, wall_s=60, memory_mb=1024, steps=500)


def _number(path: Path, text: str) -> int:
    return next(i for i, line in enumerate(path.read_text().splitlines(), 1) if text in line)


def test_lines_are_recorded_from_the_first_observation(toycar: Workspace, tmp_path: Path) -> None:
    manifest = toycar.manifest("toycar")
    engine = ReferenceEngine(manifest, tmp_path, LIMITS)
    plain, noted = (
        engine.execute(
            Job(name=name, scenario=toycar.scenario("A"), seed=7, note_executed_lines=name == "noted"),
            tmp_path / name,
        )
        for name in ("plain", "noted")
    )
    assert plain.status is noted.status is Status.OK
    assert (plain.out / "log.npz").read_bytes() == (noted.out / "log.npz").read_bytes()
    assert not plain.executed_lines
    sensing = manifest.root / "toycar" / "sensing.py"
    lines = noted.executed_lines["toycar/sensing.py"]
    assert _number(sensing, "gap = world.gap") in lines
    assert _number(sensing, "self.reading = (100.0") not in lines
    assert "toycar/show.py" not in noted.executed_lines


def count_runs(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    runs: list[str] = []
    measured = executed_lines_and_types._run_and_read_reports
    monkeypatch.setattr(
        executed_lines_and_types,
        "_run_and_read_reports",
        lambda *given: (runs.append("run"), measured(*given))[1],
    )
    return runs


def test_a_run_that_notes_types_notes_the_lines_too(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One golden run serves both."""
    manifest = toycar.manifest("toycar")
    drive = GoldenRunInputs(scenario=toycar.scenario("A"), changes=(), seed=7)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "lines"))
    lines = measure_executed_lines(manifest, [drive], LIMITS)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "both"))
    runs = count_runs(monkeypatch)
    assert measure_variable_types(manifest, [drive], LIMITS)["toycar/sensing.py"]
    assert measure_executed_lines(manifest, [drive], LIMITS) == lines and len(runs) == 1


def test_executed_lines_are_cached(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    manifest = toycar.manifest("toycar")
    drive = GoldenRunInputs(scenario=toycar.scenario("A"), changes=(), seed=7)
    runs = count_runs(monkeypatch)
    [first] = measure_executed_lines(manifest, [drive], LIMITS)
    assert [first] == measure_executed_lines(manifest, [drive], LIMITS) and len(runs) == 1
    [entry] = cache_layout_and_pruning.cached_executed_lines_folder().iterdir()
    entry.write_text(entry.read_text().replace("[", "[1,", 1))
    assert [first] == measure_executed_lines(manifest, [drive], LIMITS) and len(runs) == 2
    broken = tmp_path / "broken.yaml"
    broken.write_text("steps: many\n")
    with pytest.raises(MutatorError, match="the golden run of broken"):
        measure_executed_lines(manifest, [GoldenRunInputs(scenario=broken, changes=(), seed=7)], LIMITS)
