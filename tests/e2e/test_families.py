"""Campaigns, benches and trials in scenarios that families give, driven on the toy car."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

import mutator
from mutator._common.files import json_bytes
from mutator.campaigns import plan_growth
from mutator.campaigns.plan import build_plan
from mutator.errors import CheckFailed, MutatorError
from mutator.execution.campaign_running import run_campaign
from mutator.model import Experiment
from mutator.store import trace_packing
from mutator.store.plan_choices import Choices
from mutator.store.planned_scenarios import SCENARIOS_FILE
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace
from tests.e2e.toy_family import FAMILY, forge_digests, with_family

pytestmark = pytest.mark.filterwarnings(
    "ignore:no golden run reaches the trigger", "ignore:no experiment reached a hazard"
)


CopyToycar = Callable[[Path], Workspace]


@pytest.fixture(scope="module")
def forked_run(tmp_path_factory: pytest.TempPathFactory, copy_toycar: CopyToycar) -> Path:
    """The campaign of `families`, run in forks. Tests must not write to its folder."""
    folder = tmp_path_factory.mktemp("families")
    assert run_campaign(with_family(copy_toycar(folder)), "toy", folder / "run", engine="fork").exit_code == 0
    return folder / "run"


def test_engines_and_sessions_give_the_same_bytes_in_a_family(
    families: Workspace, forked_run: Path, tmp_path: Path
) -> None:
    whole, parts = forked_run, tmp_path / "parts"
    for number in (1, 2):
        shard = Choices(shard=f"{number}/2")
        out = tmp_path / f"shard{number}"
        mutator.run("toy", workspace=families, out=out, choices=shard, engine="reference")
    mutator.merge_runs([tmp_path / "shard1", tmp_path / "shard2"], parts)
    assert (parts / "results.csv").read_bytes() == (whole / "results.csv").read_bytes()
    folder = RunFolder.open(whole)
    assert RunFolder.open(parts).head.plan == folder.head.plan
    assert {golden.scenario for golden in folder.listed_goldens} == {"A"}
    assert len({golden.scenario for golden in folder.golden_runs}) == 4
    assert "family follow" in folder.head.sources
    assert mutator.verify(whole, workspace=families).differences == ()


def test_tables_pages_and_filters_are_by_family(families: Workspace, tmp_path: Path) -> None:
    """Scenarios of a family are one entry of tables and pages; their values are columns, also in filters."""
    whole = mutator.plan("toy", workspace=families)
    assert {"family", "ego_mps", "gap_m", "lead_mps"} <= set(whole.rows()[0])
    ego_mps = max(row["ego_mps"] or 0 for row in whole.rows())
    only = f'family == "follow" and ego_mps >= {ego_mps}'
    run = mutator.run("toy", workspace=families, out=tmp_path / "run", choices=Choices(only=only))
    frame = run.results
    assert set(frame["ego_mps"]) == {ego_mps}
    assert set(frame["family"]) == {"follow"}
    head = (run.path / "plan.csv").read_text().splitlines()[0]
    assert head.endswith(",condition,family,ego_mps,gap_m,lead_mps")
    [scenario] = run.families.index
    assert run.families.loc[scenario, ["ego_mps", "experiments", "golden_hazards"]].tolist() == [
        ego_mps,
        len(frame),
        "",
    ]
    experiment = run.experiment(frame.index[0]).experiment
    assert experiment.drive_label.startswith(f"follow, ego {ego_mps} m/s, gap ")
    report = run.report().markdown.read_text()
    assert "1 concrete scenario," in report
    by_scenario = report.partition("## By scenario")[2].partition("## ")[0]
    assert "| follow |" in by_scenario
    assert scenario not in by_scenario
    assert mutator.verify(run.path, workspace=families).differences == ()


@pytest.mark.usefixtures("without_figures")
def test_frequencies_of_the_road_weigh_the_shares(families: Workspace, tmp_path: Path) -> None:
    """A family with a `frequency` has weighted shares, as long as its file is as it was when planned. An even
    sample has counts, because the draw decides its shares.
    """
    family, run = families.library / "families" / "follow.yaml", tmp_path / "run"
    campaign = families.library / "campaigns" / "toy.yaml"
    part = "{from: 14, to: 17, weight: 3}, {from: 17, to: 20, weight: 1}"
    text = family.read_text().replace(
        "template:", f"frequency: {{source: A count, of: {{ego_mps: [{part}]}}}}\ntemplate:"
    )
    family.write_text(text)
    mutator.run("toy", workspace=families, out=tmp_path / "even")
    even = mutator.load_run(tmp_path / "even", workspace=families).report().markdown.read_text()
    of_family = even.partition("### follow")[2].partition("## ")[0]
    assert "| hazard |" in of_family and "%" not in of_family
    campaign.write_text(campaign.read_text().replace("sample: 16", "sample: 16\nproportional: true"))
    mutator.run("toy", workspace=families, out=run)
    assert "weighted share |" in mutator.load_run(run, workspace=families).report().markdown.read_text()
    family.write_text(text.replace("weight: 3", "weight: 4"))
    assert "weighted share |" not in mutator.load_run(run, workspace=families).report().markdown.read_text()


def test_a_parameter_with_the_name_of_a_column_is_refused(families: Workspace) -> None:
    family = families.library / "families" / "follow.yaml"
    family.write_text(
        family.read_text().replace("lead_mps", "status").replace("{{ lead_mps }}", "{{ status }}")
    )
    with pytest.raises(MutatorError, match="parameter 'status' of family follow clashes with a column"):
        build_plan(families, "toy")


def test_an_edited_scenario_is_found(families: Workspace, tmp_path: Path) -> None:
    run = tmp_path / "run"
    mutator.plan("toy", workspace=families, out=run)
    path = run / SCENARIOS_FILE
    lines = path.read_text().splitlines(keepends=True)
    for old, new in (
        ('"gap_m":40', '"gap_m":30'),
        ("speed: ", "speed: 1"),
        ('"goldens":[[[]],[["alone"]]]', '"goldens":[[[]]]'),
    ):
        changed = "".join(lines).replace(old, new)
        assert changed != "".join(lines), old
        path.write_text(changed)
        forge_digests(run)
        assert mutator.verify(run, workspace=families).differences, old
    path.write_text("".join(lines))
    forge_digests(run)
    assert mutator.verify(run, workspace=families).differences == ()


def test_edits_of_a_packed_golden_run_are_found(
    families: Workspace, forked_run: Path, tmp_path: Path
) -> None:
    """Golden runs of families are packed. Whoever edits one needs as many forgeries as for any other, and
    changes the seal.
    """
    out = Path(shutil.copytree(forked_run, tmp_path / "run"))
    run = mutator.load_run(out, workspace=families)
    seal, results_digest = run.seals.seal, run.seals.results_digest
    packed = sorted((out / "golden").glob("*.packed"))
    keys = {golden.key for golden in run.folder.golden_runs if golden.scenario.startswith("follow-")}
    assert {path.stem for path in packed} == keys
    assert {path.name for path in (out / "golden").iterdir() if path.is_dir()} == {"A", "A+alone"}
    assert not run.golden(packed[0].stem.partition("+")[0]).empty
    before = packed[0].read_bytes()

    packed[0].write_bytes(packed[1].read_bytes())
    assert mutator.verify(out, workspace=families).differences
    with pytest.raises(MutatorError, match="changed: "):
        mutator.load_run(out, workspace=families)
    forge_digests(out)
    differences = " ".join(map(str, mutator.verify(out, workspace=families).differences))
    assert f"golden run {packed[0].stem} with digest" in differences
    whole = (out / "checks.json").read_bytes()
    checks = json.loads(whole)
    checks["goldens"][packed[0].stem] = checks["goldens"][packed[1].stem]
    (out / "checks.json").write_bytes(json_bytes(checks))
    forge_digests(out)
    assert mutator.verify(out, workspace=families).differences
    assert mutator.load_run(out, workspace=families).seals.seal != seal

    (out / "checks.json").write_bytes(whole)
    packed[0].write_bytes(before[:-9] + bytes(9))
    forge_digests(out)
    differences = " ".join(map(str, mutator.verify(out, workspace=families).differences))
    assert "a damaged golden run" in differences
    packed[0].unlink()
    mutator.verify(out, workspace=families, repair=True)
    run_campaign(families, "toy", out, engine="fork")
    assert packed[0].read_bytes() == before
    assert mutator.load_run(out, workspace=families).seals.results_digest == results_digest


def test_seals_do_not_depend_on_packing(
    families: Workspace, forked_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another version of the compressor gives other bytes, but the golden runs are the same."""
    monkeypatch.setattr(trace_packing, "_LZMA_PRESET", 0)
    run_campaign(families, "toy", tmp_path / "run", engine="fork")
    runs = (forked_run, tmp_path / "run")
    files = [{p.name: p.read_bytes() for p in (run / "golden").glob("*.packed")} for run in runs]
    assert files[0].keys() == files[1].keys()
    assert files[0] != files[1]
    seals = [mutator.load_run(run, workspace=families).seals for run in runs]
    assert seals[0] == seals[1]


def test_a_bench_takes_scenarios_of_families(families: Workspace, tmp_path: Path) -> None:
    out = tmp_path / "bench"
    with mutator.open_bench(families, out, target="toycar") as bench:
        first = bench.build_experiment("sensor/distance/longer", "follow:ego=14,gap=30,lead=18", "2")
        [record] = bench.run([first])
        second = bench.build_experiment("sensor/distance/longer", "follow:ego=15,gap=30,lead=18", "2")
        assert len(bench.run([first, second])) == 2
    assert len(list((out / "golden").glob("follow-*.packed"))) == 2
    assert record.experiment_id == first.id
    assert mutator.verify(out, workspace=families).differences == ()
    with mutator.open_bench(families, out, target="toycar") as bench:
        assert bench.run([first])[0] == record


@pytest.mark.parametrize("killed", [pytest.param(False, marks=pytest.mark.slow), True])
def test_the_plan_csv_of_a_bench_has_columns_of_families(
    families: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, killed: bool
) -> None:
    """They come with the first scenario of a family, and the rows before get them, too. A command that is
    killed while it plans this batch leaves no trace of it.
    """
    folder, out = families.library / "families", tmp_path / "bench"
    other = FAMILY.replace("name: follow", "name: other").replace("gap_m", "space_m")
    (folder / "other.yaml").write_text(other)
    scenarios = ("A", "follow:ego=14,gap=30,lead=18", "other:ego=14,space=30,lead=18", "A")

    def heads_after(scenario: str, trigger: str) -> str:
        with mutator.open_bench(families, out, target="toycar") as bench:
            bench.run([bench.build_experiment("sensor/distance/longer", scenario, trigger)])
        return (out / "plan.csv").read_text().splitlines()[0].partition(",condition")[2]

    assert heads_after(scenarios[0], "2") == ""
    if killed:
        with monkeypatch.context() as patch:
            patch.setattr(plan_growth, "write_atomic", _die)
            patch.setattr(plan_growth.GrowingPlan, "_renew_plan_csv", lambda plan: None)
            with pytest.raises(KeyboardInterrupt):
                heads_after(scenarios[1], "2")
        assert (out / "plan.csv").read_text().splitlines()[0].endswith("lead_mps")
    assert heads_after(scenarios[1], "2") == ",family,ego_mps,gap_m,lead_mps"
    assert heads_after(scenarios[2], "2") == ",family,ego_mps,gap_m,lead_mps,space_m"
    assert heads_after(scenarios[3], "3") == ",family,ego_mps,gap_m,lead_mps,space_m"
    frame = pd.read_csv(out / "plan.csv")
    assert frame["family"].fillna("").tolist() == ["", "follow", "other", ""]
    assert frame["space_m"].fillna(0).tolist() == [0, 0, 30, 0]
    assert mutator.verify(out, workspace=families).differences == ()


def _die(path: Path, data: bytes) -> None:
    raise KeyboardInterrupt


def test_a_trial_in_a_scenario_of_a_family(families: Workspace) -> None:
    trial = mutator.try_fault(
        "sensor/distance/longer", "follow:ego=14,gap=30,lead=18", "2", workspace=families, target="toycar"
    )
    assert trial.status is mutator.Status.OK
    assert trial.experiment.scenario.startswith("follow-")


def test_seeds_share_the_scenarios_of_the_first(families: Workspace) -> None:
    campaign = families.library / "campaigns" / "toy.yaml"
    campaign.write_text(campaign.read_text().replace("seed: 7", "seeds: {from: 7, to: 8}"))
    experiments: list[Experiment] = [*build_plan(families, "toy").experiments]
    by_seed = {seed: {e.scenario for e in experiments if e.seed == seed} for seed in (7, 8)}
    assert by_seed[7] == by_seed[8]
    others = {e.scenario for e in build_plan(families, "toy", Choices(seed=8)).experiments}
    assert others != by_seed[8]


def test_a_fork_that_differs_stops_the_family(
    families: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A target that behaves otherwise in a forked process is found by the runs on the reference engine."""
    car = families.manifest("toycar").root / "toycar" / "world.py"
    text = car.read_text()
    car.write_text(f"import os\n_LOADED_BY = os.getpid()\n{text}")
    moved = "self.gap += (self.lead_speed - self.speed) * STEP"
    assert moved in text
    car.write_text(car.read_text().replace(moved, f"{moved} + 1e-9 * (os.getpid() != _LOADED_BY)"))
    with pytest.raises(CheckFailed, match="a fork of the loaded target gives other bytes"):
        run_campaign(families, "toy", tmp_path / "run", engine="fork")


def test_a_library_scenario_with_the_name_of_a_drawn_one_is_refused(families: Workspace) -> None:
    drawn = next(e.scenario for e in build_plan(families, "toy").experiments if e.concrete)
    scenarios = families.library / "scenarios"
    (scenarios / f"{drawn}.yaml").write_bytes((scenarios / "B.yaml").read_bytes())
    campaign = families.library / "campaigns" / "toy.yaml"
    campaign.write_text(campaign.read_text().replace("[A,", f"[A, {drawn},"))
    with pytest.raises(MutatorError, match="from the library and from a family"):
        build_plan(families, "toy")


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("{family: fellow, sample: 3}", "no family of scenarios 'fellow'.*did you mean 'follow'"),
        ("{family: follow, sample: 300}", "only 28 scenarios"),
        ("{family: follow, sampling: dice}", "`sampling`"),
        ("{family: ../x}", "'../x'|no family"),
        ("{family: follow, sampling: sobol}", "without a `sample`"),
        ("{family: follow}, {family: follow}", "'family follow' is listed twice"),
    ],
)
def test_a_mistake_in_a_campaign_is_refused_with_its_line(
    families: Workspace, entry: str, message: str
) -> None:
    campaign = families.library / "campaigns" / "toy.yaml"
    text = campaign.read_text().replace("{family: follow, sample: 3, sampling: sobol}", entry)
    campaign.write_text(text)
    with pytest.raises(MutatorError, match=message) as refusal:
        build_plan(families, "toy")
    assert refusal.value.line == 5
