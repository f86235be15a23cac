"""Finished runs in the Python API."""

import dataclasses
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import mutator
from mutator.api import run_experiments
from mutator.api.runs import Run
from mutator.errors import MutatorError
from mutator.execution.single_run import rerun_experiment, run_single
from mutator.model import Experiment, Outcome, Status
from mutator.store import plan_file
from mutator.store.checksummed_lines import LineWriter
from mutator.store.packed_patches import PatchWriter
from mutator.store.records import RECORDS_SCHEMA
from mutator.store.run_folder import RunFolder
from mutator.store.time_series_folder import TimeSeriesFolder
from mutator.workspace import Workspace

LANE = 'fault_type == "lane" and method == "random"'
LEFT = (("gap", 2.5, 3.0), ("gas", 2.0, 0.5))
PAGE = Path(__file__).parents[4] / "docs" / "how-to" / "use-in-a-notebook.md"


def became(e: Experiment) -> dict[str, Any]:
    if e.fault.fault_type == "silence":
        return {"status": Status.CRASHED, "outcome": None}
    hazard = {"outcome": Outcome.HAZARD, "hazards": (("H3", 4.0), ("H1", 4.5))}
    return hazard | {"left": LEFT} if e.fault.fault_type == "lane" else {}


@pytest.fixture(scope="module")
def run(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    write_run: Callable[..., Path],
) -> Run:
    folder = tmp_path_factory.mktemp("load")
    toycar = copy_toycar(folder)
    return mutator.load_run(write_run(toycar, folder / "first", became), workspace=toycar)


def test_propagation_is_available_as_frames(run: Run) -> None:
    frame = run.propagation()
    lanes = run.results.index[run.results["fault_type"] == "lane"]
    assert list(frame["experiment_id"].unique()) == sorted(lanes)
    assert frame.groupby("channel")["max_dev"].first().to_dict() == {"gap": 3.0, "gas": 0.5}
    one = run.experiment(lanes[0])
    assert one.propagation()["t_first"].to_dict() == {"gas": 2.0, "gap": 2.5}
    assert list(one.propagation()["unit"]) == ["-", "m"] and list(one.propagation().index) == ["gas", "gap"]
    assert one.fault_path is None  # no channel of the toy names a component


def test_the_columns_of_the_frame_have_types(run: Run) -> None:
    frame = run.results
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


def test_the_hazard_of_a_crash_is_unknown(run: Run) -> None:
    frame = run.results
    lane, silence = (frame[frame["fault_type"] == name] for name in ("lane", "silence"))
    assert lane["hazard"].all()
    assert set(lane["t_hazard"]) == {4.0}
    assert silence["hazard"].isna().all()
    assert not frame[frame["fault_type"] == "distance"]["hazard"].any()


def test_a_run_has_a_one_line_repr_faults_and_provenance(run: Run) -> None:
    assert repr(run) == "<Run first: 24 of 24 experiments of toy, as_described>"
    assert run.provenance["campaign"] == "toy"
    assert {"sources", "seed", "stretches", "choices"} <= set(run.provenance)
    assert set(run.results["fault_id"]) == set(run.faults)
    assert list(run.experiments) == list(plan_file.experiment_ids(run.path))


@pytest.fixture(scope="module")
def driven_once(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    write_run: Callable[..., Path],
) -> Path:
    """A run of one simulated experiment, without a trace."""
    root = tmp_path_factory.mktemp("driven")
    toycar = copy_toycar(root)
    folder = RunFolder.open(
        write_run(toycar, root / "run", lambda e: None, campaign="small", only=LANE, limit=1)
    )
    [experiment] = plan_file.load_experiments(folder.path)
    single = run_single(toycar, toycar.manifest("toycar"), experiment, root / "single")
    golden = folder.golden_folder(experiment.scenario, experiment.changes)
    golden.parent.mkdir()
    single.golden.rename(golden)
    patches = PatchWriter(folder.path, "0002-a")
    patches.append(experiment.id, (root / "single" / "mutant.patch").read_bytes())
    patches.close()
    lines = LineWriter(
        folder.path / "records" / "0002-a.jsonl", {"schema": RECORDS_SCHEMA, "plan": folder.head.plan}
    )
    lines.append(dataclasses.asdict(single.record))
    lines.close()
    return folder.path


@pytest.fixture
def driven(driven_once: Path, toycar: Workspace, tmp_path: Path) -> Run:
    run = shutil.copytree(driven_once, tmp_path / "runs" / "first")
    return mutator.load_run(run, workspace=toycar)


def test_traces_are_frames_and_exact_traces_need_a_rerun(driven: Run) -> None:
    """Exact traces have all channels in double precision, and each request for them reruns the experiment."""
    [name] = driven.results.index
    golden = driven.golden("A")
    assert (golden.index.name, len(golden)) == ("time", 120)
    assert golden.attrs["units"]["speed"] == "m/s"
    assert not (driven.path / "traces").exists()
    experiment = driven.experiment(name[:6])
    traces = experiment.traces()
    channels = ["gas", "brake", "wheel_turn", "gap", "speed"]
    assert list(traces.faulty.columns) == list(traces.golden.columns) == channels
    assert np.allclose(traces.golden, golden[channels], rtol=1e-6, atol=0.0)
    assert traces.golden.attrs["units"]["speed"] == "m/s"
    assert traces.difference["wheel_turn"].abs().max() > 0.0
    kept = driven.path / "traces" / name / "faulty" / "log.npz"
    assert kept.is_file()
    before = kept.stat().st_mtime_ns
    assert experiment.traces().faulty.equals(traces.faulty)
    assert kept.stat().st_mtime_ns == before
    exact = experiment.traces(exact=True)
    assert exact.golden.equals(golden) and list(exact.faulty.columns) == list(golden.columns)
    assert np.allclose(traces.faulty, exact.faulty[channels], rtol=1e-6, atol=0.0)
    assert kept.stat().st_mtime_ns > before


def test_an_experiment_has_a_diff_a_record_and_a_plot(driven: Run) -> None:
    [name] = driven.results.index
    experiment = driven.experiment(name)
    assert "# fi:" in experiment.diff
    assert "_fi.py" in experiment.patch
    assert "_fi.py" not in experiment.diff
    assert experiment.fault.fault_type == "lane"
    assert experiment.record is not None
    assert experiment.verdict["outcome"] == experiment.ending == driven.results["outcome"][name]
    assert "wheel_turn" in [axis.get_ylabel().split("\n")[0] for axis in experiment.plot().axes]
    assert repr(experiment) in unescape(experiment._repr_html_())


def test_only_a_rerun_that_equals_the_record_is_kept(driven: Run) -> None:
    experiment = driven.experiment(driven.results.index[0])
    trial = experiment.rerun()
    assert trial.same_as_record is True
    assert len(trial.traces().faulty) == 120
    assert not (driven.path / "traces").exists()
    assert not experiment.is_drawn
    kept = TimeSeriesFolder(driven.path).rerun_series_path(experiment.id)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            run_experiments,
            "rerun_experiment",
            lambda *where, **more: (rerun_experiment(*where, **more)[0], False),
        )
        assert experiment.rerun(keep=True).same_as_record is False
    assert not kept.exists()
    experiment.rerun(keep=True)
    assert experiment.is_drawn
    assert kept.exists()


@pytest.mark.slow
def test_two_processes_can_request_the_same_series(driven: Run) -> None:
    [name] = driven.results.index
    library = driven.workspace.library
    look = (
        "import mutator, sys\n"
        "run = mutator.load_run(sys.argv[1])\n"
        "print(len(run.experiment(sys.argv[2]).traces().faulty))"
    )
    words = [sys.executable, "-c", look, str(driven.path), name]
    environment = {**os.environ, "MUTATOR_ROOT": str(library.parent)}
    both = [
        subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        for _ in range(2)
    ]
    assert [one.communicate(timeout=120)[0] for one in both] == ["120\n"] * 2
    assert sorted(path.name for path in (driven.path / "traces" / name).iterdir()) == [
        "faulty",
        "mutant.patch",
    ]


@pytest.mark.slow
def test_the_code_of_the_notebook_page_runs(
    driven: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = driven.workspace.library
    monkeypatch.setenv("MUTATOR_ROOT", str(library.parent))
    small = (library / "campaigns" / "small.yaml").read_text()
    (library / "campaigns" / "quickstart.yaml").write_text(small.replace("name: small", "name: quickstart"))
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 5
    names: dict[str, Any] = {}
    for block in blocks:
        exec(compile(block, PAGE, "exec"), names)
    assert names["traces"].difference["wheel_turn"].abs().max() > 0.0
    assert names["experiment"].fault.fault_type == "lane"
    assert names["second"].summary.done == 12
    assert names["trial"].outcome == "hazard"


def test_missing_data_is_an_error(run: Run, tmp_path: Path) -> None:
    with pytest.raises(MutatorError, match="no golden run Z"):
        run.golden("Z")
    with pytest.raises(MutatorError, match="no experiment 'zz'"):
        run.experiment("zz")
    with pytest.raises(MutatorError, match="not a run folder"):
        mutator.load_run(tmp_path)


def test_a_planned_experiment_has_a_diff_but_no_traces(
    toycar: Workspace, tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    run = mutator.load_run(write_run(toycar, tmp_path / "r", lambda e: None), workspace=toycar)
    experiment = run.experiment(next(iter(run.experiments)))
    assert "# fi:" in experiment.diff
    assert (experiment.record, experiment.ending) == (None, "not run")
    for ask in (experiment.traces, experiment.plot):
        with pytest.raises(MutatorError, match=r"has not run yet.*mutator run toy --out"):
            ask()


def test_a_displayed_run_names_its_harness_errors(
    toycar: Workspace, tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    run = mutator.load_run(
        write_run(
            toycar,
            tmp_path / "r",
            lambda e: {"status": Status.HARNESS_ERROR, "outcome": None, "detail": "oh"},
        )
    )
    assert "24 with a HARNESS ERROR" in repr(run)
    assert "HARNESS ERROR" in run._repr_html_()
    assert set(run.harness_errors.values()) == {"oh"}


def test_a_run_writes_exports_and_reports(run: Run) -> None:
    assert run.export("csv").read_bytes() == (run.path / "results.csv").read_bytes()
    with pytest.raises(MutatorError, match=r"'xls'.*expected one of codequality, csv, junit, mcap"):
        run.export("xls")
    written = run.report()
    assert written.rows == 24
    assert run.report() == written
    run.check_equivalence()
