"""Each set of defences has a run of its own, and the undefended run is as without them."""

import csv
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

import mutator
from mutator.cli.app import app
from mutator.errors import MutatorError
from mutator.execution.campaign_running import run_campaign
from mutator.model import Outcome
from mutator.report.report_builder import write_report
from mutator.results.table_reader import Results
from mutator.store.run_deletion import delete_run
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

from .command import Bytes, Command, pytest_words, results

CopyToycar = Callable[[Path], Workspace]
SETS = ("emergency_brake", "pedal_limit+emergency_brake")
KEY = "defences: [none, emergency_brake, [pedal_limit, emergency_brake]]\n"


def results_of_all(run: Path) -> dict[str, Bytes]:
    """Return what each set gave, and as `""` what the run without defences did."""
    goldens = {path.name: path.read_bytes() for path in (run / "golden").rglob("*.npz")}
    return {"": results(run) | goldens} | {name: results(run / "defended" / name) for name in SETS}


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory, copy_toycar: CopyToycar) -> tuple[Workspace, Path]:
    """The defended campaign, run in one process. Tests must not write to its folder."""
    folder = tmp_path_factory.mktemp("defended")
    workspace = copy_toycar(folder)
    summary = run_campaign(workspace, "defended", folder / "run")
    assert summary.exit_code == 0
    assert [*summary.defended] == [*SETS]
    return workspace, folder / "run"


def test_a_defence_prevents_what_it_is_for(places: tuple[Workspace, Path]) -> None:
    """The emergency brake stops collisions, and its record says how; it does nothing about lanes."""
    run = places[1]
    undefended, defended = (RunFolder.open(path).records() for path in (run, run / "defended" / SETS[0]))
    collided = {name for name, record in undefended.items() if "H1" in dict(record.hazards)}
    assert collided
    for name in collided:
        (brake,) = defended[name].defences
        assert "H1" not in dict(defended[name].hazards)
        assert (brake.name, brake.steps >= brake.activations > 0) == ("emergency_brake", True)
        assert {command for command, _, _ in brake.commands} <= {"gas", "brake"}
    in_lane = {name for name, record in undefended.items() if "H3" in dict(record.hazards)}
    assert in_lane and all("H3" in dict(defended[name].hazards) for name in in_lane)
    assert all(not record.defences for record in undefended.values())


def test_a_set_has_its_own_checks_and_no_canary(places: tuple[Workspace, Path]) -> None:
    """Its golden runs are those of the defended tree, and what the defences did in them is kept."""
    folder = RunFolder.open(places[1] / "defended" / SETS[1])
    checks = json.loads((folder.path / "checks.json").read_text())
    assert [result["name"] for result in checks["results"]] == ["anchors", "golden A", "null mutant A"]
    report = json.loads((folder.golden_folder("A") / "defences.json").read_text())
    assert report["pedal_limit"]["steps"] > 0 == report["emergency_brake"]["steps"]
    undefended = RunFolder.open(places[1])
    assert folder.head.plan == undefended.head.plan
    assert folder.head.sources["target"] != undefended.head.sources["target"]
    assert [defence.name for defence in folder.head.defences] == ["pedal_limit", "emergency_brake"]


def test_the_undefended_run_is_as_without_the_key(
    places: tuple[Workspace, Path], copy_toycar: CopyToycar, tmp_path: Path
) -> None:
    """All but the campaign's text is the same to the byte: records, golden runs, proof and tables."""
    workspace = copy_toycar(tmp_path)
    path = workspace.campaign("defended")
    path.write_text(path.read_text().replace(KEY, ""))
    run = tmp_path / "run"
    assert run_campaign(workspace, "defended", run).exit_code == 0
    assert not (run / "defended").exists()
    for kind in ("records", "proof"):
        assert RunFolder.open(run).records(kind) == RunFolder.open(places[1]).records(kind)
    assert results(run) == results(places[1])
    heads = [json.loads((path / "run.json").read_text()) for path in (run, places[1])]
    assert {key for key in heads[0] if heads[0][key] != heads[1][key]} <= {"campaign_digest", "stretches"}
    assert heads[0].keys() == heads[1].keys()


@pytest.mark.parametrize(
    "more",
    [
        pytest.param({"workers": 2}, id="workers"),
        pytest.param({"engine": "reference"}, id="reference", marks=pytest.mark.slow),
    ],
)
def test_workers_and_engine_change_no_byte(
    places: tuple[Workspace, Path], tmp_path: Path, more: dict[str, object]
) -> None:
    summary = run_campaign(places[0], "defended", tmp_path / "run", reuse=False, **more)  # type: ignore[arg-type]
    assert summary.exit_code == 0
    assert results_of_all(tmp_path / "run") == results_of_all(places[1])


def test_a_finished_campaign_runs_nothing_again(places: tuple[Workspace, Path]) -> None:
    before = results_of_all(places[1])
    summary = run_campaign(places[0], "defended", places[1])
    assert [summary.ran, *(one.ran for one in summary.defended.values())] == [0, 0, 0]
    assert results_of_all(places[1]) == before


def test_an_audit_covers_each_set(places: tuple[Workspace, Path]) -> None:
    """It finds no difference, and tells the seals of the sets."""
    audit = mutator.verify(places[1], workspace=places[0])
    assert audit.passed, str(audit)
    assert {f"defended/{name}, seal" for name in SETS} <= audit.facts.keys()
    counts = {check.checked_parts: check.checked_count for check in audit.checks}
    assert {counts[f"defended/{name}"] for name in SETS} == {RunFolder.open(places[1]).head.experiments}


def test_an_audit_finds_what_was_changed_in_a_set(
    places: tuple[Workspace, Path], copy_toycar: CopyToycar, tmp_path: Path
) -> None:
    run = shutil.copytree(places[1], tmp_path / "run")
    golden = next((run / "defended" / SETS[0] / "golden").rglob("defences.json"))
    golden.write_text(golden.read_text().replace("null", "1.0", 1))
    audit = mutator.verify(run, workspace=places[0])
    assert not audit.passed
    assert "defences.json" in str(audit)


def test_the_library_must_stay_the_same(
    places: tuple[Workspace, Path], copy_toycar: CopyToycar, tmp_path: Path
) -> None:
    """A set whose defence was edited is not continued."""
    workspace = copy_toycar(tmp_path)
    run = shutil.copytree(places[1], tmp_path / "run")
    assert run_campaign(workspace, "defended", run).ran == 0
    path = workspace.defences["emergency_brake"]
    path.write_text(path.read_text().replace("value: 1.5", "value: 1.6"))
    with pytest.raises(MutatorError, match=r"sources changed .* defence emergency_brake"):
        run_campaign(workspace, "defended", run)


def test_outcomes_of_both_runs_can_be_compared(places: tuple[Workspace, Path]) -> None:
    """Records are paired by id."""
    runs = [RunFolder.open(path).records() for path in (places[1], places[1] / "defended" / SETS[0])]
    assert runs[0].keys() == runs[1].keys()
    outcomes = [[record.outcome for record in records.values()] for records in runs]
    assert outcomes[0].count(Outcome.HAZARD) > outcomes[1].count(Outcome.HAZARD)


@pytest.mark.slow
def test_shards_are_merged_with_their_sets(places: tuple[Workspace, Path], tmp_path: Path) -> None:
    """The merged folder has the same results as a single run, in each set, too."""
    from mutator.execution.shard_merging import merge_shards
    from mutator.store.plan_choices import Choices

    shards = [tmp_path / "1", tmp_path / "2"]
    for number, shard in enumerate(shards, 1):
        choices = Choices(shard=f"{number}/2")
        assert run_campaign(places[0], "defended", shard, choices=choices).exit_code == 0
    merge_shards(shards, tmp_path / "out")
    assert results_of_all(tmp_path / "out") == results_of_all(places[1])


def test_a_plan_freezes_the_sets(copy_toycar: CopyToycar, tmp_path: Path) -> None:
    """The folders are there before anything runs, and each verb opens them."""
    workspace = copy_toycar(tmp_path)
    plan = mutator.plan("defended", tmp_path / "run", workspace=workspace)
    for name in SETS:
        assert RunFolder.open(tmp_path / "run" / "defended" / name).head.plan == plan.digest


def test_an_unknown_defence_is_refused_before_anything_is_planned(
    copy_toycar: CopyToycar, tmp_path: Path
) -> None:
    workspace = copy_toycar(tmp_path)
    path = workspace.campaign("defended")
    path.write_text(path.read_text().replace("[none, emergency_brake,", "[none, emergency_brakes,"))
    with pytest.raises(MutatorError, match=r"defended\.yaml:\d+: no defence 'emergency_brakes'; .*one of"):
        mutator.plan("defended", tmp_path / "run", workspace=workspace)
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
def test_a_cluster_gives_the_same_bytes(places: tuple[Workspace, Path], tmp_path: Path) -> None:
    run = mutator.run("defended", tmp_path / "run", cluster="local:2", reuse=False, workspace=places[0])
    assert run.summary and run.summary.exit_code == 0
    assert results_of_all(tmp_path / "run") == results_of_all(places[1])


def test_the_report_begins_with_defences(places: tuple[Workspace, Path], tmp_path: Path) -> None:
    """Its tables say what they prevented and cost, and list each pair."""
    run = tmp_path / "run"
    shutil.copytree(places[1], run)
    report = write_report(run, places[0])
    text = report.markdown.read_text()
    assert text.index("## Defences") < text.index("## What is dangerous")
    undefended = RunFolder.open(run).records()
    defended = RunFolder.open(run / "defended" / SETS[1]).records()
    hazardous = {name for name, record in undefended.items() if record.hazards}
    acted = {name for name, record in defended.items() if record.defences}
    tables = report.page.parent / "tables"
    with (tables / "defences.csv").open() as file:
        lines = {line["defences"]: line for line in csv.DictReader(file)}
    assert [int(line["hazards"]) for line in lines.values()] == [len(hazardous)] * len(SETS)
    assert int(lines[SETS[1]]["unneeded activations"]) == len(acted - hazardous)
    with (tables / "defended_pairs.csv").open() as file:
        listed = {line["experiment"] for line in csv.DictReader(file) if line["defences"] == SETS[1]}
    assert listed == hazardous | acted
    assert [*mutator.load_run(run).defended] == sorted(SETS)
    with (tables / "defended_experiments.csv").open() as file:
        fates = {line["experiment"]: line[f"with {SETS[0]}"] for line in csv.DictReader(file)}
    assert fates.keys() == undefended.keys()
    no_hazard = {name for name, record in undefended.items() if not record.hazards}
    assert {name for name, fate in fates.items() if fate == "no hazard"} == no_hazard
    assert "that latency, one step, here 50 ms, is part of its reaction time" in text
    of_run = report.page.read_text()
    assert "const Defences" in of_run and "unneeded activation</dt>" in of_run
    page = (report.page.parent / "defended" / SETS[1] / "index.html").read_text()
    changed = {name for name in hazardous if undefended[name].hazards != defended[name].hazards}
    assert changed and all(f'data-a="{name}"' in page for name in changed)


def test_a_report_without_defences_says_nothing_of_them(
    places: tuple[Workspace, Path], tmp_path: Path
) -> None:
    """Its page has no script, column, term or table of theirs."""
    run = tmp_path / "run"
    shutil.copytree(places[1], run, ignore=shutil.ignore_patterns("defended"))
    report = write_report(run, places[0])
    page = report.page.read_text()
    assert all(word not in page for word in ("const Defences", "unneeded activation", "with_defences"))
    assert not [*(report.page.parent / "tables").glob("defen*")]


def test_an_experiment_says_which_defences_acted(
    places: tuple[Workspace, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """When first, how often and with what authority; in a run without defences, nothing."""
    monkeypatch.setenv("MUTATOR_ROOT", str(places[0].library.parent))

    def show(*words: object) -> str:
        result = CliRunner().invoke(app, ["show", *map(str, words)])
        assert result.exit_code == 0, result.output
        return result.output.replace("\u00a0", " ")

    folder = places[1] / "defended" / SETS[0]
    records = RunFolder.open(folder).records()
    name, activity = next((name, record.defences[0]) for name, record in records.items() if record.defences)
    text = show(name, "--run", folder)
    assert f"{activity.first:.2f}" in text and "defence emergency_brake first acts" in text
    assert f"defence emergency_brake: first acted at {activity.first:.2f} s, 1 activation, " in text
    assert "furthest from 0, it commanded gas 0, brake 1" in text
    assert json.loads(show(name, "--run", folder, "--json"))["defences"][0]["name"] == "emergency_brake"
    idle = next(name for name, record in records.items() if not record.defences)
    assert "no defence acted" in show(idle, "--run", folder)
    assert "defence" not in show(name, "--run", places[1])
    assert "defences" not in json.loads(show(name, "--run", places[1], "--json"))


def test_a_defended_run_says_how_it_ended(places: tuple[Workspace, Path]) -> None:
    """Only runs with defences have the columns on them."""
    undefended, defended = (Results(path).frame() for path in (places[1], places[1] / "defended" / SETS[0]))
    assert "defence" not in undefended
    assert {"emergency_brake", ""} == set(defended["defence"])
    braked = defended[defended["defence"] != ""]
    assert (braked["defence_activations"] > 0).all() and (braked["t_defence"] > 0.0).all()
    assert (braked["authority_brake"] == 1.0).all()
    assert (braked["after_fault_s"] >= 0.0).all()
    assert not defended["driver_at_end"].any()


@pytest.mark.parametrize("workers", [0, pytest.param(2, marks=pytest.mark.slow)])
def test_pytest_shows_the_experiments_of_each_set(
    places: tuple[Workspace, Path], tmp_path: Path, workers: int
) -> None:
    """An item for each experiment of each set, and the same bytes as by `mutator run`."""
    words = [*pytest_words(tmp_path / "run", "defended", workers), "-v", "--campaign-no-reuse"]
    told = Command(places[0], tmp_path / "run", *words).end()
    count = RunFolder.open(places[1]).head.experiments
    assert f"{3 * count} passed" in told, told
    for name in SETS:
        assert told.count(f"::{name}--sensor/") >= count
    assert results_of_all(tmp_path / "run") == results_of_all(places[1])


@pytest.mark.slow
def test_a_killed_command_is_resumed_in_its_set(places: tuple[Workspace, Path], tmp_path: Path) -> None:
    """Killed while a set runs, the same command goes on there, and the bytes are those of a whole run."""
    run = tmp_path / "run"
    words = ("-m", "mutator", "run", "defended", "--out", str(run), "-n", "2", "--no-reuse", "--no-stills")
    command = Command(places[0], run, *words)
    command.wait_for(run / "defended" / SETS[0] / "records")
    command.kill()
    assert "hazard" in Command(places[0], run, *words).end()
    assert results_of_all(run) == results_of_all(places[1])


def test_a_run_is_deleted_with_its_sets(places: tuple[Workspace, Path], tmp_path: Path) -> None:
    """Nothing is left of the folder, and no file of a set is a stranger's."""
    run = shutil.copytree(places[1], tmp_path / "run")
    delete_run(run)
    assert not run.exists()


def test_folders_that_were_swapped_or_linked_are_refused(
    places: tuple[Workspace, Path], tmp_path: Path
) -> None:
    """One set's results are never shown or continued under another one's name."""
    run = shutil.copytree(places[1], tmp_path / "run")
    first, second = (run / "defended" / name for name in SETS)
    first.rename(tmp_path / "first")
    second.rename(first)
    (tmp_path / "first").rename(second)
    for use in (lambda: write_report(run, places[0]), lambda: run_campaign(places[0], "defended", run)):
        with pytest.raises(MutatorError, match=r"the defences pedal_limit\+emergency_brake"):
            use()
    (run / "defended").rename(tmp_path / "sets")
    (run / "defended").symlink_to(tmp_path / "sets")
    with pytest.raises(MutatorError, match="defended"):
        write_report(run, places[0])


@pytest.mark.usefixtures("without_figures")
def test_a_report_is_written_whatever_the_order_of_a_set(copy_toycar: CopyToycar, tmp_path: Path) -> None:
    """Defences act by priority, which need not be the order of the campaign."""
    workspace = copy_toycar(tmp_path)
    path = workspace.campaign("defended")
    path.write_text(path.read_text().replace(KEY, "defences: [none, [emergency_brake, pedal_limit]]\n"))
    assert run_campaign(workspace, "defended", tmp_path / "run").exit_code == 0
    write_report(tmp_path / "run", workspace)
    assert (tmp_path / "run" / "report" / "tables" / "defences_without_faults.csv").is_file()
