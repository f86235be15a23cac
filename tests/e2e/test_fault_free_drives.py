"""Campaigns without faults drive the scenarios of families, on the toy car."""

import dataclasses
import json
import shutil
from pathlib import Path

import pandas as pd
import pytest

import mutator
from mutator._common.files import json_bytes
from mutator.campaigns.plan import build_plan, load_plan
from mutator.campaigns.plan_tally import plan_digest
from mutator.errors import CheckFailed, MutatorError
from mutator.execution.campaign_running import run_campaign
from mutator.preflight import forked_golden_runs
from mutator.store.file_digests import FileDigest
from mutator.store.golden_verdicts import load_golden_verdicts
from mutator.store.plan_choices import Choices
from mutator.store.planned_scenarios import SCENARIOS_FILE
from mutator.store.preflight_results import check_results
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace
from tests.e2e.toy_family import forge_digests

pytestmark = pytest.mark.filterwarnings(
    "ignore:no golden run reaches the trigger", "ignore:no experiment reached a hazard"
)


@pytest.fixture
def few_references(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drive three golden runs of the families on the reference engine, instead of twenty."""
    monkeypatch.setattr(forked_golden_runs, "_LEAST_DRIVEN_ON_REFERENCE", 3)


def plan_digest_of_drives(run: Path) -> str:
    plan = load_plan(RunFolder(run))
    return plan_digest([], (), plan.canary.id if plan.canary else "", plan.campaign, plan.drives)


def without_faults(families: Workspace, count: int) -> None:
    campaign = families.library / "campaigns" / "toy.yaml"
    head, _, rest = campaign.read_text().partition("faults:")
    canary = next(line for line in rest.splitlines() if line.startswith("canary"))
    text = head.replace("sample: 3", f"sample: {count}")
    campaign.write_text(f"{text}faults: []\nseed: 7\n{canary}\n")


@pytest.mark.usefixtures("few_references")
def test_a_campaign_without_faults_drives_its_scenarios(families: Workspace, tmp_path: Path) -> None:
    without_faults(families, 6)
    out = tmp_path / "run"
    assert run_campaign(families, "toy", out, engine="fork").exit_code == 0
    run = mutator.load_run(out, workspace=families)
    drives = run.drives()
    assert len(drives) == 7
    assert set(drives["scenario"]) == {"A", "follow"}
    assert {"ego_mps", "gap_m", "driven_s"} <= set(drives.columns)
    assert drives["driven_s"].min() > 5
    assert [path.name for path in (out / "golden").iterdir()] == [
        "A"
    ]  # the traces of the others are not kept
    assert run.drives_note().startswith("7 fault-free drives, ")
    family = next(result for result in check_results(run.folder) if result.name == "family follow")
    assert family.detail.startswith("6 golden runs, 3 of them")
    assert mutator.verify(out, workspace=families).differences == ()
    assert run_campaign(families, "toy", out, engine="fork").seal == run.seals.seal
    other = tmp_path / "other"
    assert run_campaign(families, "toy", other, engine="reference").exit_code == 0
    pd.testing.assert_frame_equal(mutator.load_run(other, workspace=families).drives(), drives)


def test_equal_drives_of_several_seeds_count_once(families: Workspace, tmp_path: Path) -> None:
    """The hours of a drive that another seed repeats are no more hours. Those of another drive are."""
    without_faults(families, 3)
    campaign, manifest = families.campaign("toy"), families.library / "targets" / "toycar.yaml"
    campaign.write_text(campaign.read_text().replace("seed: 7", "seeds: {from: 7, to: 8}"))
    text, notes = manifest.read_text(), []
    assert '--number, "{seed}"' in text
    for seed in ("{seed}", "7"):
        manifest.write_text(text.replace('--number, "{seed}"', f'--number, "{seed}"'))
        out = tmp_path / str(len(notes))
        run_campaign(families, "toy", out, engine="fork")
        run = mutator.load_run(out, workspace=families)
        notes.append(run.drives_note())
        assert len(run.drives()) == 8
        assert mutator.verify(out, workspace=families).differences == ()
    assert notes[0].startswith("8 fault-free drives, 0.01 h; hazards")
    assert notes[1].startswith("4 fault-free drives, 0.01 h; 4 more are equal, with other seeds; hazards")
    checks = json.loads((out / "checks.json").read_text())
    checks["verdicts"]["A@8"]["trace_digest"] = "0" * 64  # as if it had been another drive
    (out / "checks.json").write_bytes(json_bytes(checks))
    forge_digests(out)
    assert mutator.verify(out, workspace=families).differences


@pytest.mark.usefixtures("few_references")
def test_a_crash_without_a_fault_names_the_scenario(families: Workspace, tmp_path: Path) -> None:
    """Nothing runs, and the message has the values with which `mutator try` drives the scenario."""
    without_faults(families, 6)
    world = families.manifest("toycar").root / "toycar" / "world.py"
    moved = "self.gap += (self.lead_speed - self.speed) * STEP"
    text = world.read_text()
    assert moved in text
    indent = text[: text.index(moved)].rpartition("\n")[2]
    world.write_text(text.replace(moved, f"{moved}\n{indent}assert self.gap < 41 or self.gap > 90"))
    with pytest.raises(CheckFailed, match=r"of \d+ checks .*golden follow-\w+: crashed: .*gap_m=40.*\)"):
        run_campaign(families, "toy", tmp_path / "run", engine="fork")
    assert not list((tmp_path / "run").glob("records/*"))


@pytest.mark.usefixtures("few_references")
def test_forged_results_of_drives_are_found(families: Workspace, tmp_path: Path) -> None:
    without_faults(families, 6)
    run = tmp_path / "run"
    run_campaign(families, "toy", run, engine="fork")
    whole = {
        path: path.read_bytes() for path in (run / "checks.json", run / SCENARIOS_FILE, run / "run.json")
    }
    checks = json.loads((run / "checks.json").read_text())
    checks["verdicts"]["A"]["duration_s"] = 360_000.0  # its trace is kept
    (run / "checks.json").write_bytes(json_bytes(checks))
    forge_digests(run)
    assert mutator.verify(run, workspace=families).differences
    for path, data in whole.items():
        path.write_bytes(data)
    lines = (run / SCENARIOS_FILE).read_text().splitlines(keepends=True)
    (run / SCENARIOS_FILE).write_text("".join(lines[:3]))  # as if it had never been drawn
    checks = json.loads((run / "checks.json").read_text())
    names = ["A", *(json.loads(line)["name"] for line in lines[:3])]
    for key in ("goldens", "verdicts"):
        checks[key] = {name: checks[key][name] for name in names}
    (run / "checks.json").write_bytes(json_bytes(checks))
    head = json.loads((run / "run.json").read_text())
    head["scenarios"] = FileDigest.of_file(run / SCENARIOS_FILE).sha256
    (run / "run.json").write_bytes(json_bytes(head))
    head["plan"] = plan_digest_of_drives(run)
    (run / "run.json").write_bytes(json_bytes(head))
    forge_digests(run)
    differences = " ".join(map(str, mutator.verify(run, workspace=families).differences))
    assert "which the campaign draws" in differences


def test_hazards_of_a_drive_are_listed_by_time(families: Workspace, tmp_path: Path) -> None:
    """Also if the manifest names the later one first."""
    too_fast = "steps: 120\nspeed: 40\ngap: 70\nlead_speed: -10\nlead_brakes: 0.8\n"
    (families.library / "scenarios" / "FAST.yaml").write_text(too_fast)
    without_faults(families, 3)
    campaign = families.campaign("toy")
    campaign.write_text(campaign.read_text().replace("[A, ", "[A, FAST, "))
    run_campaign(families, "toy", tmp_path / "run", engine="fork")
    folder = RunFolder(tmp_path / "run")
    assert [name for name, _ in folder.golden_hazards["FAST"]] == ["TOO_FAST", "H1"]
    assert load_golden_verdicts(folder)["FAST"].hazards == folder.golden_hazards["FAST"]
    assert mutator.verify(folder.path, workspace=families).differences == ()


def test_choices_among_experiments_are_refused_without_faults(families: Workspace) -> None:
    without_faults(families, 5)
    for choices in (Choices(only="value > 1"), Choices(limit=3), Choices(shard="1/2")):
        with pytest.raises(MutatorError, match="the campaign has no faults"):
            build_plan(families, "toy", choices)


@pytest.mark.usefixtures("few_references")
def test_a_target_that_cannot_be_forked_is_driven_on_the_reference_engine(
    families: Workspace, tmp_path: Path
) -> None:
    without_faults(families, 6)
    world = families.manifest("toycar").root / "toycar" / "world.py"
    wait = "threading.Thread(target=threading.Event().wait, daemon=True).start()"
    world.write_text(f"import threading\n{wait}\n{world.read_text()}")
    assert run_campaign(families, "toy", tmp_path / "run", engine="fork").exit_code == 0


@pytest.mark.usefixtures("few_references")
@pytest.mark.skipif(shutil.which("bwrap") is None, reason="needs bubblewrap")
def test_families_run_in_a_sandbox(families: Workspace, tmp_path: Path) -> None:
    without_faults(families, 6)
    sandboxed = dataclasses.replace(families, sandbox=True)
    assert run_campaign(sandboxed, "toy", tmp_path / "run", engine="fork").exit_code == 0
