"""`mutator show` and `mutator rerun`, on a finished run of the toy target."""

import json
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.store.time_series_folder import TimeSeriesFolder, load_rerun_series

from .finished_runs import experiment_with

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json
Reseal = Callable[..., None]  # recomputes every checksum and digest of a run folder


def test_show_prints_diff_times_verdict_and_plot(cli: Cli, run: Path) -> None:
    name = experiment_with(run, "hazard")
    answer = cli("show", name, "--plot")
    assert answer.code == 0
    for wanted in (name, "# fi:", "verdict: hazard", "fault first active", "hazard H", "largest difference"):
        assert wanted in answer.out
    [plot] = [line.removeprefix("plot: ") for line in answer.out.splitlines() if line.startswith("plot: ")]
    assert ET.parse(plot).getroot().tag.endswith("svg")
    assert load_rerun_series(TimeSeriesFolder(run).rerun_series_path(name))[1].facts["hazards"]
    page = Path(cli("report", run, "--json").json["page"]).read_text()
    assert f'"series": {{"packed": true, "kept": ["{name}"]' in page


def test_show_without_an_experiment_lists_the_worst_ones(cli: Cli, run: Path) -> None:
    listed = cli("show", "--json").json
    endings = [line["ending"] for line in listed["worst"]]
    assert endings == sorted(endings, key=lambda ending: ending != "hazard")
    assert endings[0] == "hazard"
    assert sum(1 + line["more"] for line in listed["worst"]) <= listed["count"]
    only = cli("show", "--only", 'outcome == "hazard" and t_activation > 0', "--limit", "1", "--json").json
    assert only["worst"][0].items() <= listed["worst"][0].items()
    assert only["count"] < listed["count"]
    answer = cli("show", "--run", run)
    assert answer.code == 0
    assert listed["worst"][0]["experiment"] in answer.out
    assert "the worst first" in answer.out
    assert "unknown column `speed`" in cli("show", "--only", "speed > 3").err


def test_show_reads_and_only_drives_when_asked(cli: Cli, run: Path, tmp_path: Path) -> None:
    name, copy = experiment_with(run, "hazard"), tmp_path / "copy"
    shutil.copytree(run, copy, ignore=shutil.ignore_patterns("plots", "traces", "kept"))

    def files() -> dict[Path, int]:
        return {path: path.stat().st_mtime_ns for path in copy.rglob("*")}

    before = files()
    answer = cli("show", name, "--run", copy)
    assert files() == before
    assert "verdict: hazard" in answer.out and "# fi:" in answer.out and "recorded on:" in answer.out
    [last] = answer.out.splitlines()[-1:]
    assert last.endswith(f"mutator show {name} --run {copy} --plot")
    assert "plot: " not in answer.out
    answer = cli("show", name, "--run", copy, "--drive")
    assert "plot: " in answer.out
    new = set(files()) - set(before)
    assert {path.relative_to(copy).parts[0] for path in new} == {"plots", "traces", "series"}
    again, before = cli("show", name, "--run", copy), files()
    assert (again.out, files()) == (answer.out, before)


def test_show_imports_no_engine(run: Path) -> None:
    code = """import sys
from mutator.cli.app import main
code = main(sys.argv[1:])
print([name for name in sys.modules if name.startswith("mutator.engines.")])
sys.exit(code)"""
    words = [sys.executable, "-c", code, "show", experiment_with(run, "hazard"), "--run", str(run)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    # needed by help texts and by the limits of stored runs; neither module imports an engine
    assert done.stdout.splitlines()[-1] == "['mutator.engines.engine_kinds', 'mutator.engines.run_limits']"


def test_show_accepts_an_id_prefix(cli: Cli, run: Path) -> None:
    name = experiment_with(run, "hazard")
    answer = cli("show", name[:8], "--json", "--no-plot").json
    assert answer["experiment"] == name
    assert answer["outcome"] == "hazard"
    assert cli("show", name[:8], "--run", run, "--no-plot").code == 0
    assert cli("show", name, "--patch").out == answer["patch"]
    assert cli("diff", name[:8]).code == 0


@pytest.mark.parametrize("name", ["", "0123456789abcdef", "xyz"])
def test_an_unknown_or_ambiguous_id_is_refused(cli: Cli, run: Path, name: str) -> None:
    answer = cli("show", name)
    assert answer.code == 2
    assert "Traceback" not in answer.err


def test_show_says_that_an_experiment_has_not_run_yet(cli: Cli, root: Path) -> None:
    cli("plan", "toy", "--out", "runs/p", "--limit", "2")
    name = results_id(Path("runs/p/plan.csv"))
    answer = cli("show", name)
    assert answer.code == 0
    assert "has not run yet" in answer.out
    assert "# fi:" in answer.out


def results_id(table: Path) -> str:
    return table.read_text().splitlines()[1].split(",")[0]


def test_rerun_reproduces_the_record_and_leaves_no_files(cli: Cli, run: Path) -> None:
    name = experiment_with(run, "sdc")
    answer = cli("rerun", name)
    assert answer.code == 0
    assert "the same as the campaign's record" in answer.out
    assert not (run / "traces" / name).exists()


def test_rerun_stores_a_trace(cli: Cli, run: Path) -> None:
    name = experiment_with(run, "sdc")
    answer = cli("rerun", name, "--trace", "--json").json
    assert answer["same_as_record"] is True
    assert (Path(answer["traces"]) / "log.npz").is_file()
    assert Path(answer["plot"]).is_file()


def test_rerun_fails_if_the_record_differs(cli: Cli, run: Path, tmp_path: Path, reseal: Reseal) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(run, copy)
    name = experiment_with(run, "hazard")
    for file in (copy / "records").iterdir():
        lines = [json.loads(line) for line in file.read_text().splitlines()]
        for line in lines:
            if line.get("experiment_id") == name:
                line["t_manifest"] += 1.0
        file.write_text("".join(json.dumps(line) + "\n" for line in lines))
    reseal(copy)
    answer = cli("rerun", name, "--run", copy)
    assert answer.code == 1
    assert "DIFFERS" in answer.out
