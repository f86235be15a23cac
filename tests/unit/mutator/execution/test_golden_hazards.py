"""Campaigns with a scenario whose golden run has a hazard."""

import csv
import shutil
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.execution.frozen_plan import open_or_freeze_run
from mutator.execution.session import Session
from mutator.execution.session_items import SessionItems
from mutator.execution.session_opening import open_session
from mutator.exports.formats.mutation_elements import mutant_status_as_json
from mutator.model import AgainstGolden, Outcome, Record, Status
from mutator.preflight import equivalence_check
from mutator.store.checks_file import CHECKS_FILE
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

# the other car comes towards it: a contact at 2.45 s
CRASH = "steps: 120\nspeed: 30\ngap: 70\nlead_speed: -10\nlead_brakes: 0.8\n"


CopyToycar = Callable[[Path], Workspace]


@pytest.fixture
def with_crash(toycar: Workspace) -> Workspace:
    """The toy's campaign `small`, in scenario A and in CRASH, whose golden run has a contact."""
    return add_crash(toycar)


def add_crash(toycar: Workspace) -> Workspace:
    (toycar.library / "scenarios" / "CRASH.yaml").write_text(CRASH)
    path = toycar.campaign("small")
    text = path.read_text().replace("scenarios: [A]", "scenarios: [A, CRASH]")
    longer = "  - {spec: sensor/distance/longer, values: 2}\n"
    path.write_text(text.replace("faults:\n", f"faults:\n{longer}"))
    return toycar


@pytest.fixture(scope="module")
def whole_run(tmp_path_factory: pytest.TempPathFactory, copy_toycar: CopyToycar) -> mutator.Run:
    """The whole campaign, run once for all tests, which must not write to its folder."""
    folder = tmp_path_factory.mktemp("whole")
    return mutator.run("small", folder / "run", workspace=add_crash(copy_toycar(folder)))


def include(workspace: Workspace) -> None:
    path = workspace.campaign("small")
    path.write_text(path.read_text() + "include: hazard_without_fault\n")


def records_by_scenario(run: mutator.Run) -> dict[str, list[Record]]:
    records: dict[str, list[Record]] = {}
    for experiment in run.experiments.values():
        key = run.folder.golden_run_of(experiment).key
        records.setdefault(key, []).append(run.records[experiment.id])
    return records


@pytest.mark.usefixtures("without_figures")
def test_experiments_whose_golden_run_has_a_hazard_are_left_out_and_named(
    with_crash: Workspace, whole_run: mutator.Run, tmp_path: Path
) -> None:
    run = mutator.load_run(shutil.copytree(whole_run.path, tmp_path / "run"), workspace=with_crash)
    summary = whole_run.summary
    assert summary
    assert summary.exit_code == 0
    records = records_by_scenario(run)
    left_out = records.pop("CRASH")
    [detail] = {record.detail for record in left_out}
    assert detail.startswith("the golden run of CRASH has a hazard without any fault: H1 at ")
    assert {(r.status, r.outcome, r.tree, r.patch) for r in left_out} == {(Status.LEFT_OUT, None, "", "")}
    assert all(r.status is Status.OK and r.against_golden is None for rest in records.values() for r in rest)
    note = f"{len(left_out)} experiments of {len(run.records)} left out: {detail} ({len(left_out)}). "
    note += "`include: hazard_without_fault` in the campaign runs them."
    assert summary.golden_hazards_note == run.golden_hazards_note() == note
    assert note.replace("`", "<code>", 1).split("`")[0] in run.report().page.read_text()
    assert [*run.folder.golden_hazards] == ["CRASH"]
    rows = list(csv.DictReader((run.path / "results.csv").open()))
    classes = Counter((row["golden_class"], row["status"]) for row in rows)
    assert classes["hazard_without_fault", "left_out"] == len(left_out)
    assert classes["hazard_free", "ok"] == len(rows) - len(left_out)
    assert run.counts().rows[-1][1] == str(len(rows) - len(left_out))  # injected
    proved = run.folder.records("proof")
    assert all(record.status is Status.OK for record in proved.values())
    assert summary.proof
    assert summary.proof.is_complete
    assert mutator.verify(run.path, workspace=with_crash).differences == ()


def test_a_resume_knows_what_was_left_out_and_gives_the_same_bytes(
    with_crash: Workspace, whole_run: mutator.Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    finish = Session.finish

    def cut(session: Session, **options: bool) -> object:
        session.interrupted = True
        return finish(session, **options)

    with monkeypatch.context() as patch:
        patch.setattr(Session, "finish", cut)
        with pytest.warns(mutator.IncompleteRun):
            mutator.run("small", tmp_path / "run", workspace=with_crash)
    resumed = mutator.run("small", tmp_path / "run", workspace=with_crash)
    assert resumed.summary
    assert resumed.summary.ran == 0
    assert resumed.summary.seal == whole_run.summary.seal  # type: ignore[union-attr]
    assert (resumed.path / "results.csv").read_bytes() == (whole_run.path / "results.csv").read_bytes()


def test_a_campaign_that_includes_them_judges_what_the_fault_adds(
    with_crash: Workspace, tmp_path: Path
) -> None:
    include(with_crash)
    run = mutator.run("small", tmp_path / "run", workspace=with_crash)
    records = records_by_scenario(run)
    crashes = records.pop("CRASH")
    assert all(record.status is Status.OK for record in crashes)
    counting = {AgainstGolden.ANOTHER, AgainstGolden.EARLIER, AgainstGolden.WORSE}
    for record in crashes:
        assert (record.outcome is Outcome.NOT_ACTIVATED) is (record.against_golden is None)
        assert (record.outcome is Outcome.HAZARD) is (record.against_golden in counting)
        assert bool(record.hazards) is (record.outcome is Outcome.HAZARD)
    assert not any(record.against_golden for rest in records.values() for record in rest)
    assert run.golden_hazards_note().startswith("The golden run of CRASH (H1 at ")
    assert mutator.verify(run.path, workspace=with_crash).differences == ()
    not_judged = sum(record.outcome is Outcome.NOT_JUDGED for record in crashes)
    assert not_judged
    assert int(run.counts().rows[-1][1]) == len(run.records) - not_judged
    again = mutator.run("small", tmp_path / "again", workspace=with_crash)
    assert again.summary.seal == run.summary.seal  # type: ignore[union-attr]


def test_a_campaign_that_leaves_out_everything_fails(with_crash: Workspace, tmp_path: Path) -> None:
    choices = mutator.Choices(only="scenario == 'CRASH' and variant == 'longer'")
    with pytest.warns(mutator.IncompleteRun, match="Every experiment is left out"):
        run = mutator.run("small", tmp_path / "run", workspace=with_crash, choices=choices)
    assert run.summary
    assert run.summary.exit_code == 1
    assert run.golden_hazards_note().startswith("Every experiment is left out, so that nothing was tried: ")


def test_the_plan_of_a_campaign_that_includes_them_is_another(with_crash: Workspace) -> None:
    """Shards of both cannot be merged; ids stay, so that runs can be compared."""
    plan = mutator.plan("small", workspace=with_crash)
    include(with_crash)
    other = mutator.plan("small", workspace=with_crash)
    assert plan.digest != other.digest
    assert [e.id for e in plan.experiments] == [e.id for e in other.experiments]


def test_an_unknown_class_to_include_is_refused(with_crash: Workspace) -> None:
    path = with_crash.campaign("small")
    path.write_text(path.read_text() + "include: hazards\n")
    with pytest.raises(MutatorError, match="hazard_without_fault"):
        mutator.plan("small", workspace=with_crash)


def test_an_experiment_that_was_left_out_cannot_be_rerun(
    with_crash: Workspace, whole_run: mutator.Run
) -> None:
    """`try` runs it, with the verdict of a campaign that includes it."""
    run = whole_run
    name = next(r.experiment_id for r in run.records.values() if r.status is Status.LEFT_OUT)
    with pytest.raises(MutatorError, match="was left out: the golden run of CRASH"):
        run.experiment(name).rerun()
    trial = mutator.try_fault("sensor/distance/longer", "CRASH", "t >= 100", value=21.0, workspace=with_crash)
    assert trial.record.outcome is Outcome.NOT_ACTIVATED


def test_a_bench_follows_the_same_rules(with_crash: Workspace, tmp_path: Path) -> None:
    outcomes = {}
    for name in ("left_out", "included"):
        kind = "hazard_without_fault" if name == "included" else None
        with mutator.open_bench(with_crash, tmp_path / name, target="toycar", include=kind) as bench:
            experiment = bench.build_experiment(
                "sensor/distance/longer", "CRASH", "t >= 5", value=21.0, armed_after_s=0.0
            )
            free = bench.build_experiment("sensor/distance/longer", "A", "t >= 5", value=21.0)
            record, _ = bench.run([experiment, free])
        outcomes[name] = (record.status, record.outcome)
        folder = RunFolder.open(tmp_path / name)
        assert [*folder.golden_hazards] == ["CRASH@0"]
    assert outcomes == {"left_out": (Status.LEFT_OUT, None), "included": (Status.OK, Outcome.NOT_JUDGED)}


@pytest.mark.slow
def test_workers_that_begin_before_the_checks_end_leave_out_and_prove_the_same(
    with_crash: Workspace, tmp_path: Path
) -> None:
    alone, beside = (
        mutator.run("small", tmp_path / f"run{workers}", workspace=with_crash, workers=workers, reuse=False)
        for workers in (0, 2)
    )
    assert alone.summary and beside.summary
    assert alone.summary.seal == beside.summary.seal
    sampled = [set(equivalence_check.sample_ids_in_folder(run.folder)) for run in (alone, beside)]
    assert sampled[0] == sampled[1]
    assert sampled[0] <= {r.experiment_id for r in beside.records.values() if r.status is Status.OK}


def test_damaged_hazards_of_golden_runs_are_refused(
    with_crash: Workspace, tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    run = write_run(with_crash, tmp_path / "run")
    (run / CHECKS_FILE).write_text('{"schema": "checks/1", "golden_hazards": {"A": 3}}')
    with pytest.raises(MutatorError, match="damaged at 'golden_hazards'"):
        RunFolder(run).golden_hazards  # noqa: B018


@pytest.mark.slow
def test_merged_shards_leave_out_the_same(
    with_crash: Workspace, whole_run: mutator.Run, tmp_path: Path
) -> None:
    shards = [tmp_path / f"shard{number}" for number in (1, 2)]
    for number, out in enumerate(shards, start=1):
        choices = mutator.Choices(shard=f"{number}/2")
        mutator.run("small", out, workspace=with_crash, choices=choices, reuse=False)
    merged = mutator.merge_runs(shards, tmp_path / "merged")
    assert (merged.path / "results.csv").read_bytes() == (whole_run.path / "results.csv").read_bytes()
    assert merged.golden_hazards_note() == whole_run.golden_hazards_note()


@pytest.mark.parametrize("stored", [False, True])
def test_an_item_of_what_was_left_out_is_skipped_with_the_reason(
    with_crash: Workspace, tmp_path: Path, stored: bool
) -> None:
    """Also if an earlier session left it out."""
    choices = mutator.Choices(only="scenario == 'CRASH' and variant == 'longer'", limit=1)
    run = tmp_path / "run"
    open_run = partial(open_or_freeze_run, with_crash, "small", run, choices, reviewed=False)
    with open_session(with_crash, open_run, run, workers=0) as session:
        session.prepare()
        items = SessionItems(session=session)
        [item] = items.list_work().items
        runner = items.start_here()
        ending = runner.run(item)
        if stored:
            runner.close()
            runner = items.start_here()
            runner._pending.clear()
            ending = runner.run(item)
        runner.close()
    assert ending.problems == []
    assert ending.reason_left_out.startswith("the golden run of CRASH has a hazard without any fault")


def test_exports_do_not_judge_what_was_left_out(whole_run: mutator.Run, tmp_path: Path) -> None:
    run = whole_run
    run.export("junit", tmp_path / "junit.xml")
    cases = ET.parse(tmp_path / "junit.xml").getroot().iter("testcase")
    skipped = [case.find("skipped") for case in cases if "CRASH," in str(case.get("name"))]
    messages = [element.get("message", "") for element in skipped if element is not None]
    left_out = [record for record in run.records.values() if record.status is Status.LEFT_OUT]
    assert sum("has a hazard without any fault" in message for message in messages) == len(left_out)
    experiments = [e for e in run.experiments.values() if run.records[e.id].status is Status.LEFT_OUT]
    status = mutant_status_as_json(experiments[:1], run.records)
    assert (status["status"], status["testsCompleted"]) == ("Ignored", 0)
