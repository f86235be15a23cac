"""Runs in notebooks."""

import dataclasses
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import mutator
from mutator.api.runs import Run
from mutator.errors import MutatorError
from mutator.execution.single_run import run_single
from mutator.model import Experiment, Outcome, Status
from mutator.store import plan_file
from mutator.store.records import SCHEMA, LineWriter
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

LANE = 'fault_type == "lane" and method == "random"'
PAGE = Path(__file__).parents[4] / "docs" / "how-to" / "use-in-a-notebook.md"


def became(e: Experiment) -> dict[str, Any]:
    """Faults of the lane are hazardous, silence crashes the controller, the rest is masked."""
    if e.fault.fault_type == "silence":
        return {"status": Status.CRASHED, "outcome": None}
    hazard = {"outcome": Outcome.HAZARD, "hazards": (("H3", 4.0), ("H1", 4.5))}
    return hazard if e.fault.fault_type == "lane" else {}


@pytest.fixture(scope="module")
def run(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    write_run: Callable[..., Path],
) -> Run:
    """A toy run with made up records."""
    folder = tmp_path_factory.mktemp("load")
    toycar = copy_toycar(folder)
    return mutator.load_run(write_run(toycar, folder / "first", became), root=toycar.library.parent)


def test_the_frame_is_typed(run: Run) -> None:
    """Names are categories, flags are flags that may be unknown, times are floats with their unit."""
    frame = run.frame
    assert len(frame) == 24
    assert frame.index.name == "experiment_id"
    assert list(frame["outcome"].cat.categories) == [o.value for o in Outcome]
    assert frame["outcome"].cat.ordered
    for name in ("kind", "scenario", "method", "status"):
        assert isinstance(frame[name].dtype, pd.CategoricalDtype)
    for name in ("activated", "manifested", "h1", "h3", "too_fast", "hazard"):
        assert frame[name].dtype == "boolean"
    assert frame.attrs["units"]["t_h3"] == frame.attrs["units"]["t_hazard"] == "s"
    numbers = frame.select_dtypes("number").columns
    assert set(numbers) <= set(frame.attrs["units"])


def test_hazards_of_the_frame(run: Run) -> None:
    """Any hazard and the first one are told; of a crash it is not known whether there would have been one."""
    frame = run.frame
    lane, silence = (frame[frame["fault_type"] == name] for name in ("lane", "silence"))
    assert lane["hazard"].all()
    assert set(lane["t_hazard"]) == {4.0}
    assert silence["hazard"].isna().all()
    assert not frame[frame["fault_type"] == "distance"]["hazard"].any()


def test_it_says_what_it_is(run: Run) -> None:
    """A run is shown in one line; its faults and its provenance are at hand."""
    assert repr(run) == "<Run first: 24 of 24 experiments of toy, as_described>"
    assert run.provenance["campaign"] == "toy"
    assert {"sources", "seed", "packages", "choices"} <= set(run.provenance)
    assert set(run.frame["fault_id"]) == set(run.faults)
    assert list(run.experiments) == list(plan_file.ids(run.path))


@pytest.fixture
def driven(toycar: Workspace, tmp_path: Path, write_run: Callable[..., Path]) -> Run:
    """A run of one experiment that was really driven, with golden run, patch and record, and no trace."""
    folder = RunFolder.open(
        write_run(toycar, tmp_path / "runs" / "first", lambda e: None, campaign="small", only=LANE, limit=1)
    )
    [experiment] = plan_file.read_all(folder.path)
    single = run_single(toycar, toycar.manifest("toycar"), experiment, tmp_path / "single")
    golden = folder.golden(experiment.scenario, experiment.changes)
    golden.parent.mkdir()
    single.golden.rename(golden)
    patch = folder.patch(experiment.id)
    patch.parent.mkdir(parents=True)
    (tmp_path / "single" / "mutant.patch").rename(patch)
    lines = LineWriter(folder.path / "records" / "0002-a.jsonl", {"schema": SCHEMA})
    lines.append(dataclasses.asdict(single.record))
    lines.close()
    return mutator.load_run(folder.path, root=toycar.library.parent)


def test_traces_are_driven_when_asked_for(driven: Run) -> None:
    """Golden and faulty run are frames by time with units; the latter is driven again, once, and kept."""
    [name] = driven.frame.index
    golden = driven.golden("A")
    assert (golden.index.name, len(golden)) == ("time", 120)
    assert golden.attrs["units"]["speed"] == "m/s"
    assert not (driven.path / "traces").exists()
    faulty = driven.trace(name[:6])
    assert list(faulty.columns) == list(golden.columns)
    assert not faulty.equals(golden)
    assert (driven.path / "traces" / name / "faulty" / "log.npz").is_file()
    assert driven.trace(name) is faulty
    assert "# fi:" in driven.patch(name)


def test_the_page_about_notebooks(driven: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The code of the page runs as it is printed, one block after the other, on a run in runs/first."""
    assert driven.root is not None
    monkeypatch.setenv("MUTATOR_ROOT", str(driven.root))
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 5
    names: dict[str, Any] = {}
    for block in blocks:
        exec(compile(block, PAGE, "exec"), names)
    assert names["difference"].max() == 0.0 < (names["faulty"] - names["golden"])["wheel_turn"].abs().max()
    assert names["fault"].fault_type == "lane"


def test_what_is_not_there_is_told(run: Run, tmp_path: Path) -> None:
    """Asking for what a run does not have names what it has."""
    with pytest.raises(MutatorError, match="no golden run Z"):
        run.golden("Z")
    with pytest.raises(MutatorError, match="no patch of"):
        run.patch(run.frame.index[0])
    with pytest.raises(MutatorError, match="no experiment 'zz'"):
        run.trace("zz")
    with pytest.raises(MutatorError, match="no run folder"):
        mutator.load_run(tmp_path)


def test_only_what_is_offered_is_there() -> None:
    """The package offers `load_run` without loading pandas for it; other names are an error as ever."""
    assert "load_run" in dir(mutator)
    with pytest.raises(AttributeError, match="no attribute 'load_runs'"):
        mutator.load_runs  # noqa: B018
