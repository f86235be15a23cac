"""The commands that run campaigns, make reports and delete runs, on the toy target."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.cli import plan_and_run_commands
from mutator.errors import MutatorError
from mutator.store import recorded_approvals
from mutator.store.allowed_contents import ALLOWED_FILE_GLOBS

from .finished_runs import CHOSEN, results

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json
Reseal = Callable[..., None]  # recomputes every checksum and digest of a run folder


def test_a_run_has_a_worker_for_each_usable_core(
    cli: Cli, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plan_and_run_commands, "usable_cores", lambda: 3)
    started: list[int] = []

    def run(*_: object, workers: int, **__: object) -> None:
        started.append(workers)
        raise MutatorError("enough")

    monkeypatch.setattr("mutator.run", run)
    planned = cli("plan", "toy", "--out", "p")
    assert "with 3 workers" in planned.out
    assert "run it: mutator run toy --out p\n" in planned.out
    for words in ([], ["-n", "0"], ["-n", "1"]):
        assert cli("run", "toy", "--out", "p", *words).err.startswith("error: enough")
    assert started == [3, 0, 1]


@pytest.mark.parametrize("engine", ["reference", "fork"])
def test_a_fault_that_hides_a_name_is_refused_before_any_run(cli: Cli, root: Path, engine: str) -> None:
    """The fault would make a module's name local to a function."""
    driver = root / "tree" / "toycar" / "driver.py"
    driver.write_text("HEADWAY_S = 1.5\n" + driver.read_text().replace("1.5 * speed", "HEADWAY_S * speed"))
    spec = root / "fault_library" / "faults" / "sensor" / "lane.yaml"
    place = "{file: toycar/driver.py, function: Driver.drive, entry: true}"
    text = re.sub(r"at: .*", f"at: {place}", spec.read_text())
    spec.write_text(text.replace("{by_m: offset}", "{by_m: offset, target: HEADWAY_S}"))
    answer = cli("run", "small", "--out", "r", "--engine", engine)
    assert answer.code == 1
    assert "sensor/lane/shifted" in answer.err
    assert "driver.py:12: the lines would make 'HEADWAY_S' local in drive" in answer.err
    assert not list(Path("r").glob("golden/*"))


def test_run_prints_the_table_and_the_path_of_the_report(finished: tuple[Path, Any]) -> None:
    root, said = finished
    lines = said.stdout.splitlines()
    assert lines[0].split()[:5] == ["fault", "type", "injected", "activated", "manifested"]
    assert any(line.startswith("total ") for line in lines)
    assert "12 of 12 experiments done, 12 now" in said.stdout
    [report] = [line for line in lines if line.startswith("report: ")]
    assert (root / "runs/first/report/REPORT.md").exists()
    assert "runs/first/report/REPORT.md" in report
    assert "experiments " in said.stderr  # progress goes to stderr


def test_run_begins_with_hazards_that_defences_cause_without_a_fault(
    cli: Cli, root: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Such a set costs more than it saves, whatever its outcomes. A pytest session says it, too."""
    defence = root / "fault_library" / "defences" / "emergency_brake.yaml"
    text = defence.read_text().replace("lowest_brake: {value: 1.0", "lowest_gas: {value: 1.0")
    text = text.replace("highest_gas: {value: 0,", "highest_brake: {value: 0,")
    text = text.replace("ttc < limit", "ttc > -limit").replace("closing <= 0", "gap > 10000")
    defence.write_text(text)
    campaign = root / "fault_library" / "campaigns" / "defended.yaml"
    text = campaign.read_text()
    campaign.write_text(text.replace(", [pedal_limit, emergency_brake]]", "]"))
    answer = cli("run", "defended", "--out", "r", "-n", "0", "--limit", "2")
    assert answer.code == 0
    first, second = answer.out.splitlines()[:2]
    assert re.fullmatch(
        r"with emergency_brake, a hazard without any fault, by a defence: A \(H1 at \d+\.\d\d s.*\)", first
    )
    assert second.startswith("fault type")
    plain = ("-c", os.devnull, "--rootdir", ".", "-p", "no:hypothesispytest", "--assert=plain")
    pytest.main([*plain, "--campaign", "defended", "--campaign-out", "r"])
    assert first in capfd.readouterr().out.splitlines()


def test_table_and_seal_do_not_wait_for_stills_and_report(
    cli: Cli, run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise MutatorError("no report today")

    monkeypatch.setattr("mutator.api.runs.Run.report", fail)
    answer = cli("run", "toy", "--out", run, *CHOSEN, "-n", "0")
    assert answer.code == 2
    assert "no report today" in answer.err
    assert answer.out.startswith("fault type ")
    assert "\nseal: " in answer.out
    assert "\nreport: " not in answer.out


def test_run_takes_results_from_earlier_runs_unless_it_is_told_not_to(cli: Cli, root: Path) -> None:
    """It says how many results it took. With `--no-reuse` it runs everything, and the seal is the same."""
    words = ("run", "small", "-n", "0", "--out")
    first = cli(*words, "first", "--json").json
    assert "12 of 12 reused: earlier runs had the same experiments" in cli(*words, "second").out
    second, third = cli(*words, "second", "--json").json, cli(*words, "third", "--no-reuse", "--json").json
    assert (first["reused"], third["reused"], third["ran"]) == (0, 0, 12)
    assert first["seal"] == second["seal"] == third["seal"]


def test_running_a_finished_run_changes_nothing(cli: Cli, run: Path) -> None:
    before = results(run)
    answer = cli("run", "toy", "--out", run, *CHOSEN, "-n", "0")
    assert answer.code == 0
    assert "12 of 12 experiments done, 0 now" in answer.out
    assert results(run) == before


def test_with_json_a_run_prints_only_numbers_and_paths(cli: Cli, run: Path) -> None:
    answer = cli("run", "toy", "--out", run, *CHOSEN, "-n", "0", "--json").json
    assert (answer["planned"], answer["done"], answer["ran"]) == (12, 12, 0)
    assert sum(answer["outcomes"].values()) == 12
    assert Path(answer["report"]).exists()


def test_other_choices_need_another_folder(cli: Cli, run: Path) -> None:
    answer = cli("run", "toy", "--out", run, "--limit", "9")
    assert answer.code == 2
    assert "--limit" in answer.err


def wait_for(folder: Path, files: str) -> None:
    deadline = time.monotonic() + 60
    while not any(folder.glob(files)) and time.monotonic() < deadline:
        time.sleep(0.05)


@pytest.mark.slow
def test_an_interrupted_run_prints_the_command_that_resumes_it(cli: Cli, root: Path) -> None:
    words = ["run", "toy", "--out", "runs/cut", "-n", "0", "--limit", "6"]
    command = [sys.executable, "-m", "mutator", *words]
    environment = os.environ | {"MUTATOR_ROOT": str(root)}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        wait_for(Path("runs/cut"), "run.json")
        process.send_signal(signal.SIGSTOP)  # leaves time for the second command
        try:
            second = cli(*words)
        finally:
            process.send_signal(signal.SIGCONT)
        wait_for(Path("runs/cut"), "records/*.jsonl")
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert second.code == 2
    assert "in use" in second.err
    assert process.returncode == 130
    assert "resume: mutator run toy --out runs/cut -n 0 --limit 6" in out + err
    assert "Traceback" not in err
    again = cli(*words)
    assert again.code == 0
    assert "6 of 6 experiments done" in again.out


def test_report_rebuilds_results_byte_for_byte(cli: Cli, run: Path) -> None:
    files = [run / "results.csv", run / "report/REPORT.md", run / "report/index.html"]
    before = [file.read_bytes() for file in files]
    for file in files:
        file.unlink()
    answer = cli("report", run)
    assert answer.code == 0
    assert [file.read_bytes() for file in files] == before
    assert "report/REPORT.md" in answer.out


def test_report_of_a_folder_of_runs_is_their_history(cli: Cli, run: Path, tmp_path: Path) -> None:
    shutil.copytree(run, tmp_path / "runs" / "first")
    answer = cli("report", tmp_path / "runs", "--json")
    assert answer.code == 0
    assert answer.json["runs"] == 1
    assert "| first |" in Path(answer.json["markdown"]).read_text()


def test_report_writes_one_file_to_send(cli: Cli, run: Path, tmp_path: Path) -> None:
    """It is named after its run and lies next to other exports. A folder of runs has no such file."""
    folder = Path(shutil.copytree(run, tmp_path / "runs" / "first"))
    answer = cli("report", folder, "--single-file", "--json")
    assert answer.code == 0
    assert Path(answer.json["single_file"]) == folder / "exports" / "first-report.html"
    assert 'id="embedded-series"' in (folder / "exports" / "first-report.html").read_text()
    refused = cli("report", tmp_path / "runs", "--single-file")
    assert refused.code == 2
    assert "name one of its runs" in refused.err


def test_a_failed_proof_is_at_the_top_of_the_report(
    cli: Cli, run: Path, tmp_path: Path, reseal: Reseal
) -> None:
    run = Path(shutil.copytree(run, tmp_path / "run"))
    shutil.copytree(run / "records", run / "proof", dirs_exist_ok=True)
    path = next(path for path in sorted((run / "proof").iterdir()) if len(path.read_text().splitlines()) > 1)
    head, first, *rest = path.read_text().splitlines()
    wrong = json.loads(first) | {"trace_digest": "0" * 64}
    path.write_text("\n".join([head, json.dumps(wrong), *rest, ""]))
    reseal(run)
    answer = cli("report", run)
    assert answer.code == 1
    assert f"experiment {wrong['experiment_id']} differs on the reference engine" in answer.err
    text = (run / "report/REPORT.md").read_text()
    assert text.index("The equivalence check failed") < text.index("12 experiments")
    assert f"FAILED: experiment {wrong['experiment_id']}" in text


@pytest.mark.slow
def test_the_library_for_the_report_can_be_given(cli: Cli, run: Path, root: Path, nowhere: Path) -> None:
    assert cli("report", run).code == 0
    assert cli("report", run, "--root", root).code == 0
    answer = cli("report", run, "--root", nowhere / "none")
    assert answer.code == 2
    assert "fault_library" in answer.err


def test_the_page_loads_no_other_file(run: Path) -> None:
    text = (run / "report" / "index.html").read_text()
    text = text.replace("http://www.w3.org/2000/svg", "").replace("https://github.com/leeoniya/uPlot", "")
    assert "http" not in text
    links = re.findall(r'<[^>]* (?:href|src)="([^"]*)"', text)
    assert len(links) >= 5
    beside = [link for link in links if not link.startswith(("#", "data:"))]
    assert all((run / "report" / link).is_file() for link in beside)  # links to its other pages, nothing more
    assert not re.search(r'<(?:link|script|img|source|iframe)\b[^>]* (?:href|src)="(?!data:|#)', text)


def test_clean_deletes_only_run_folders(cli: Cli, root: Path) -> None:
    cli("plan", "toy", "--out", "runs/p", "--limit", "2")
    Path("mine").mkdir()
    assert cli("clean", "mine", "--yes").code == 2
    assert cli("clean", "runs/p").code == 2  # there is no terminal to ask for confirmation
    assert Path("runs/p/run.json").exists()
    assert cli("clean", "runs/p", "--yes").code == 0
    assert not Path("runs/p").exists()
    assert Path("mine").exists()


KNOWN = {pattern.partition("/")[0] for pattern in ALLOWED_FILE_GLOBS}  # names in a run folder


@pytest.mark.slow
def test_clean_deletes_everything_that_commands_wrote_into_a_run(cli: Cli, run: Path, tmp_path: Path) -> None:
    copy, other = tmp_path / "copy", tmp_path / "other"
    for folder in (copy, other):
        shutil.copytree(run, folder)
    name = results(run)[1].split(",")[0]
    for words in (
        ["show", name, "--run", copy, "--plot"],
        ["rerun", name, "--run", copy, "--trace"],
        ["show", name, "--run", copy, "--still", "2.0", "--video", copy / "plots" / f"{name}.mp4"],
        *(
            ["export", copy, "--format", f]
            for f in ("mutation-elements", "junit", "csv", "parquet", "sarif", "codequality")
        ),
        ["compare", other, copy],
    ):
        assert cli(*words).code == 0, words
    recorded_approvals.write_approvals(
        copy, {"schema": recorded_approvals.APPROVALS_SCHEMA, "target": "toycar", "groups": []}
    )
    for file in (next((copy / "records").iterdir()), next((copy / "patches").iterdir())):
        file.write_bytes(file.read_bytes()[:-9])
    assert cli("verify", copy, "--repair").code == 1
    # only forked runs have a proof
    resumed = cli("run", "toy", "--out", copy, *CHOSEN, "-n", "0", "--engine", "fork")
    assert resumed.code == 0, resumed.err
    for file in ("seal.json", "seal.json.sig"):  # written by `mutator seal --sign`, which needs a key
        (copy / file).write_text("{}")
    assert {path.name for path in copy.iterdir()} == KNOWN - {"workers", "work", "progress.json"}
    link = tmp_path / "link"
    link.symlink_to(copy)
    refused = cli("clean", link, "--yes")
    assert (refused.code, "a link to" in refused.err) == (2, True)
    assert cli("clean", copy, "--yes").out == f"deleted {copy}\n"
    assert not copy.exists()
