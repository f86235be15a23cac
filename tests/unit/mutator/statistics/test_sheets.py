"""All tables of a run."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from mutator.statistics.sheet import P, Sheet
from mutator.statistics.sheets import run_sheets, sheets, write
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

from .results_frame import results

HERE = Workspace.find(Path(__file__).parents[4])
GUIDED = {"t_activation": 7.0, "alerts": "fcw", "t_alert": 8.0, "t_h1": 9.0, "h1": 1}
RANDOM = GUIDED | {"method": "random", "trigger": "random/C2"}
HEADER = (
    "experiment_id,fault_id,module,fault_type,scenario,method,trigger,seed,status,t_activation,t_manifest"
)


@pytest.fixture
def run(tmp_path: Path) -> RunFolder:
    """A run folder with a guided chaff run, its random partner, and the fault-free run of 30 s."""
    head = {"schema": "run/1", "target": "openpilot", "goldens": [["S1", []]]}
    (tmp_path / "run.json").write_text(json.dumps(head))
    lines = [f"{how},a,radar,chaff,S1,{how},C2,1,ok,5,6,1,9,fcw,8" for how in ("guided", "random")]
    (tmp_path / "results.csv").write_text("\n".join([f"{HEADER},h1,t_h1,alerts,t_alert", *lines, ""]))
    (tmp_path / "golden" / "S1").mkdir(parents=True)
    np.savez(tmp_path / "golden" / "S1" / "trace.npz", t=np.arange(3000) / 100)
    return RunFolder.open(tmp_path)


def test_a_run_of_both_methods_has_all_tables(run: RunFolder) -> None:
    """Summary and coverage of each method, the comparison, and the times; alerts only with their records."""
    names = [sheet.name for sheet in run_sheets(run, HERE)]
    assert names == [
        *("summary_guided", "summary_random", "coverage_guided", "coverage_random"),
        *("guided_against_random", "guided_against_random_by_fault_type", "matched_pairs"),
        *("propagation", "alert_to_hazard", "hazard_orders"),
    ]


def test_without_a_library_ours_stand_alone(run: RunFolder) -> None:
    """Without one there is nothing of the paper, and no end of runs to censor at."""
    made = run_sheets(run, None)
    assert "alert_to_hazard" not in [sheet.name for sheet in made]
    assert {line[1] for sheet in made if sheet.name.startswith("coverage") for line in sheet.lines} == {
        "here"
    }


def test_no_tables_where_they_say_nothing_more(run: RunFolder) -> None:
    """One method and a fault type of one's own: the report's counts say it all."""
    results_file = run.path / "results.csv"
    lines = results_file.read_text().replace("chaff", "own").splitlines()
    results_file.write_text("\n".join(lines[:2]) + "\n")
    assert run_sheets(run, HERE) == ()


def test_files_are_the_same_each_time(tmp_path: Path) -> None:
    """CSV and Markdown of each table, the same bytes when written again."""
    made = sheets(results(GUIDED, RANDOM), None, {"0": (), "1": ()}, {"S1": 30.0})
    contents = []
    for _ in range(2):
        write(made, tmp_path)
        contents.append({file.name: file.read_bytes() for file in (tmp_path / "tables").iterdir()})
    assert contents[0] == contents[1]
    assert len(contents[0]) == 2 * len(made)


def test_numbers_are_written_plainly() -> None:
    """What is not known is empty or a dash, a tiny p-value no false zero, a p-value in the CSV a number."""
    sheet = Sheet(name="n", title="T", note="N.", heads=("a", "b", "c"), lines=((math.nan, P(1e-20), None),))
    assert sheet.table().rows == [["-", "< 0.0001", "-"]]
    assert sheet.csv() == "a,b,c\n,1e-20,\n"
