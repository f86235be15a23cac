"""The checks before a campaign."""

import dataclasses
import json
import re
import shutil
from pathlib import Path

import pytest

from mutator.campaigns import run_environment
from mutator.campaigns.plan import build_plan, load_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.engines.reference_engine import ReferenceEngine
from mutator.errors import CheckFailed, MutatorError
from mutator.limits import Limits, MeasuredLimits
from mutator.preflight.bench_checks import CheckedGolden
from mutator.preflight.canary_check import CanaryVerdict, run_until_hazard
from mutator.preflight.check_run_problems import CheckRun
from mutator.preflight.preflight_checks import run_checks, unpackaged_modules
from mutator.store.checks_file import (
    CHECKS_FILE,
    CHECKS_SCHEMA,
    UNPACKAGED_MODULES_KEY,
    unpackaged_modules_as_json,
)
from mutator.store.checksummed_lines import LineWriter
from mutator.store.preflight_results import unpackaged_modules_of_golden_runs
from mutator.store.records import RECORDS_SCHEMA
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import Progress
from mutator.workspace import Workspace


def frozen(toycar: Workspace, tmp_path: Path) -> RunFolder:
    return freeze_plan(build_plan(toycar, "small"), tmp_path / "run", toycar)


def change(toycar: Workspace, old: str, new: str, name: str = "go") -> None:
    path = toycar.library.parent / "tree" / "toycar" / f"{name}.py"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))


def test_a_sound_target_passes_and_is_not_checked_again(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = frozen(toycar, tmp_path)
    told: list[Progress] = []
    results = run_checks(toycar, folder, workers=2, notify=told.append)
    assert {r.name for r in results} == {
        "anchors",
        "golden A",
        "golden A+alone",
        "null mutant A",
        "null mutant A+alone",
        "canary",
    }
    assert all(r.passed for r in results)
    stages = [(one.stage, one.done, one.total) for one in told]
    checks = [("checks", done, 3) for done in range(4)]
    assert stages == checks + [("golden", done, 2) for done in range(3)]
    assert load_plan(folder).cost(2).is_measured
    monkeypatch.setattr(ReferenceEngine, "execute", None)
    assert run_checks(toycar, folder) == results


def test_a_damaged_golden_run_is_replaced(toycar: Workspace, tmp_path: Path) -> None:
    folder = frozen(toycar, tmp_path)
    run_checks(toycar, folder)
    trace = folder.golden_folder("A") / "log.npz"
    good = trace.read_bytes()
    trace.write_bytes(b"")
    run_checks(toycar, folder)
    assert trace.read_bytes() == good
    shutil.rmtree(folder.golden_folder("A", ("alone",)))
    run_checks(toycar, folder)
    assert folder.golden_folder("A", ("alone",)).is_dir()


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("case[\"gap\"] += number", "case[\"gap\"] += hash('x') % 9 + number", "nothing but PYTHONHASHSEED"),
        ("npy(column))", "npy(column) + __import__('os').urandom(1))", "different bytes"),
        ("import json\n", "import json\nimport nosuch\n", "crashed: ModuleNotFoundError"),
        ("ZipFile(to / \"log.npz\"", "ZipFile(to / \"other.npz\"", "not a readable trace"),
        ("now = world.advance", "now = 0\n        now = world.advance", "matches 2 statements"),
        ("(to / \"said.json\")", "names = sorted(__import__('os').listdir(Path(__file__).parent))\n"
         "        said['files'] = len([n for n in names if n.endswith('.py')])\n        (to / \"said.json\")",
         "the probe alone changes what the target does"),
    ],
    ids=["hash order", "random", "import", "no trace", "anchor", "sees the probe"],
)  # fmt: skip
def test_an_unsound_target_is_refused(
    toycar: Workspace, tmp_path: Path, old: str, new: str, told: str
) -> None:
    change(toycar, old, new)
    folder = frozen(toycar, tmp_path)
    with pytest.raises(CheckFailed, match=re.escape(told)):
        run_checks(toycar, folder)


@pytest.mark.slow
def test_an_observation_that_is_not_reached_is_refused(toycar: Workspace, tmp_path: Path) -> None:
    change(toycar, "        drive.step()", "        Drive.other(drive)")
    change(toycar, "    def step(self):", "    def step(self):\n        now = 0\n\n    def other(self):")
    manifest = toycar.library / "targets" / "toycar.yaml"
    manifest.write_text(
        manifest.read_text()
        .replace("d_rel: world.gap", "d_rel: now")
        .replace("v_ego: world.speed", "v_ego: now")
        .replace("v_lead: world.lead_speed", "v_lead: now")
    )
    with pytest.raises(CheckFailed, match="its trigger never fired"):
        run_checks(toycar, frozen(toycar, tmp_path))


def test_a_harmless_canary_is_refused(toycar: Workspace, tmp_path: Path) -> None:
    """A harness that misses hazards would not notice them in a campaign either."""
    path = toycar.campaign("small")
    path.write_text(path.read_text().replace("at_s: 1.0", "at_s: 5.9"))
    folder = frozen(toycar, tmp_path)
    with pytest.raises(CheckFailed, match="canary: did not reach H3 with any of its values: ") as error:
        run_checks(toycar, folder)
    assert error.value.exit_code == 1
    (spec,) = (spec for spec in toycar.specs() if spec.name == "sensor/lane")
    faults = toycar.faults("sensor/lane", seed=3)
    values = sorted((fault.value for fault in faults), reverse=True)
    assert len(values) == spec.fault_count == 4
    assert error.value.got.endswith(", ".join(f"{value} m" for value in values))


def test_a_canary_in_a_scenario_with_a_hazard_without_fault_is_refused(
    toycar: Workspace, tmp_path: Path
) -> None:
    """It would reach its hazard whatever the fault does."""
    change(toycar, 'case["gap"] += number', 'case["gap"] -= 39.9 + number')
    change(toycar, '"gap": 500.0', '"gap": 30.0')
    with pytest.raises(MutatorError) as error:
        run_checks(toycar, frozen(toycar, tmp_path))
    assert error.value.exit_code == 2
    assert error.value.got == "the canary's golden run A has a hazard without any fault, H1 at 0.00 s"
    assert Path(error.value.where or "").name == "campaign.yaml"
    assert error.value.line


def test_a_canary_that_does_harm_with_another_value_passes(toycar: Workspace, tmp_path: Path) -> None:
    change(toycar, "offset = world.offset", "shown = world.offset\n        offset = shown", "sensing")
    change(toycar, "closing, offset))", "closing, shown if offset > 2.0 else offset))", "sensing")
    results = run_checks(toycar, frozen(toycar, tmp_path))
    (canary,) = (result for result in results if result.name == "canary")
    assert canary.passed
    assert re.fullmatch(r"reached H3 with 1\.\d+ m, and not with 2\.\d+ m", canary.detail)


def test_a_missing_anchor_is_reported_before_any_run(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    change(toycar, "offset = world.offset", "shift = world.offset", "sensing")
    change(toycar, "closing, offset))", "closing, shift))", "sensing")
    folder = frozen(toycar, tmp_path)
    monkeypatch.setattr(ReferenceEngine, "execute", None)
    with pytest.raises(CheckFailed, match=r"anchors: sensor/lane/shifted: .*sensing\.py"):
        run_checks(toycar, folder)


@pytest.mark.slow
def test_changed_golden_runs_are_refused(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = frozen(toycar, tmp_path)
    run_checks(toycar, folder)
    LineWriter(
        folder.path / "records" / "0001-gw0.jsonl", {"schema": RECORDS_SCHEMA, "plan": folder.head.plan}
    ).close()
    monkeypatch.setattr(run_environment, "processor_name", lambda: "another")
    assert all(result.passed for result in run_checks(toycar, folder))
    shutil.rmtree(folder.scratch_folder)
    before = {path: path.read_bytes() for path in folder.path.rglob("*") if path.is_file()}
    monkeypatch.setattr(run_environment, "processor_name", lambda: "a third")
    original = ReferenceEngine.execute

    def other(self: ReferenceEngine, job, folder):  # type: ignore[no-untyped-def]
        execution = original(self, job, folder)
        with (execution.out / "said.json").open("a") as file:
            file.write(" ")
        return execution

    monkeypatch.setattr(ReferenceEngine, "execute", other)
    with pytest.raises(CheckFailed, match="differs from the one this run began with"):
        run_checks(toycar, folder)
    shutil.rmtree(folder.scratch_folder)
    assert {path: path.read_bytes() for path in folder.path.rglob("*") if path.is_file()} == before


def test_a_canary_whose_run_was_killed_is_run_again_once(toycar: Workspace, tmp_path: Path) -> None:
    canary = frozen(toycar, tmp_path).canary
    fine = CheckRun(problem="", hazards=(("H3", 1.0),))
    runs = iter([CheckRun(problem="crashed: killed by SIGHUP"), fine])
    assert run_until_hazard([canary], lambda _: next(runs), "H3") == CanaryVerdict(success="reached H3")
    ended = iter([CheckRun(problem="crashed")] * 2)  # a third run is not allowed
    assert "(crashed)" in run_until_hazard([canary], lambda _: next(ended), "H3").problem


def name_no_cpu_limit(toycar: Workspace) -> None:
    path = toycar.campaign("small")
    path.write_text(path.read_text().replace("cpu_s: 20, wall_s: 60, ", ""))


def test_the_golden_runs_determine_a_limit_that_the_campaign_does_not_name(
    toycar: Workspace, tmp_path: Path
) -> None:
    """It is measured once, kept when golden runs are repeated, and in no digest."""
    name_no_cpu_limit(toycar)
    plan = build_plan(toycar, "small")
    assert plan.cost().cpu_limit_s is None
    folder = freeze_plan(plan, tmp_path / "run", toycar)
    assert folder.limits == Limits(memory_mb=1024, steps=200)
    run_checks(toycar, folder)
    assert folder.limits == MeasuredLimits(cpu_s=10, wall_s=300, memory_mb=1024, steps=200)
    assert folder.head.limits == Limits(memory_mb=1024, steps=200)
    assert load_plan(folder).cost().cpu_limit_s == 10
    path = folder.path / CHECKS_FILE
    checks = json.loads(path.read_text())
    path.write_text(json.dumps(checks | {"measured_limits": {"cpu_s": 30, "wall_s": 300}}))
    shutil.rmtree(folder.golden_folder("A"))
    run_checks(toycar, folder)
    assert folder.limits.cpu_s == 30
    assert json.loads(path.read_text())["digest"] == checks["digest"]


def test_a_limit_that_the_campaign_names_is_kept(toycar: Workspace, tmp_path: Path) -> None:
    folder = frozen(toycar, tmp_path)
    run_checks(toycar, folder)
    assert folder.limits == Limits(cpu_s=20, wall_s=60, memory_mb=1024, steps=200)
    assert "measured_limits" not in json.loads((folder.path / CHECKS_FILE).read_text())


@pytest.mark.parametrize(
    "measured", [7, {"cpu_s": 10}, {"cpu_s": 0, "wall_s": 300}, {"cpu_s": "1", "wall_s": 1}]
)
def test_damaged_measured_limits_are_refused(toycar: Workspace, tmp_path: Path, measured: object) -> None:
    name_no_cpu_limit(toycar)
    folder = frozen(toycar, tmp_path)
    checks = {"schema": CHECKS_SCHEMA, "measured_limits": measured}
    (folder.path / CHECKS_FILE).write_text(json.dumps(checks))
    with pytest.raises(MutatorError, match=r"checks.json: damaged at 'measured_limits' \("):
        _ = folder.limits


@pytest.mark.slow
def test_a_canary_that_hangs_costs_its_measured_limit(toycar: Workspace, tmp_path: Path) -> None:
    name_no_cpu_limit(toycar)
    path = toycar.campaign("small")
    path.write_text(path.read_text().replace("sensor/lane/shifted, scenario", "hostile/hang/it, scenario"))
    folder = frozen(toycar, tmp_path)
    with pytest.raises(CheckFailed, match=r"\(timeout: CPU time limit, ten times the golden run's\)"):
        run_checks(toycar, folder, workers=1)


def test_a_golden_run_that_loses_an_observed_value_fails_its_check(toycar: Workspace, tmp_path: Path) -> None:
    manifest = toycar.manifest("toycar").path
    channel = "  d_rel: {unit: m, role: truth, from: gap}\nobservation:\n"
    manifest.write_text(manifest.read_text().replace("observation:\n", channel, 1))
    lost = "now = self.frame * STEP\n        if now > 1.02:\n            self.gap = float('nan')"
    change(toycar, "now = self.frame * STEP", lost, "world")
    text = "golden A: truth: d_rel is NaN at 1.05 s, and stays so to the end of the drive"
    with pytest.raises(CheckFailed, match=text):
        run_checks(toycar, frozen(toycar, tmp_path))


def test_modules_of_golden_runs_that_no_package_provides_are_stored(
    toycar: Workspace, tmp_path: Path
) -> None:
    """They decide what may be reused. Without them, checks.json has no such key, nor a bench's golden run."""
    loaded = [CheckRun(problem="", third_party_modules=("numpy", "loose", "toycar"))]
    modules = unpackaged_modules(toycar.manifest("toycar"), loaded)
    assert modules == ("loose",)
    assert unpackaged_modules_as_json(()) == {}
    checks = {"schema": CHECKS_SCHEMA, **unpackaged_modules_as_json(modules)}
    (tmp_path / CHECKS_FILE).write_text(json.dumps(checks))
    assert unpackaged_modules_of_golden_runs(RunFolder(tmp_path)) == ("loose",)
    golden = CheckedGolden(output_digest="", trace_digest="", cpu_s=0.0, packages=(), results=())
    assert UNPACKAGED_MODULES_KEY not in golden.as_json()
    golden = dataclasses.replace(golden, modules_without_package=modules)
    assert CheckedGolden.from_json(golden.as_json()) == golden
