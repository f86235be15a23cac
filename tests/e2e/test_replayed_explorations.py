"""Explorations that are replayed from their run folders."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import pytest

import mutator
from mutator.audit.head_and_checks_audit import recomputed_chunks
from mutator.explore.envelope_files import ENVELOPES_FILE
from mutator.explore.exploration_replay import replay_exploration
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace
from tests.e2e.exploration_forging import (
    Explored,
    Reseal,
    batches_of,
    check_of,
    explore,
    keep_records,
    write_batches,
)


def test_the_genuine_exploration_is_complete(exploration: Explored) -> None:
    """It follows from its records, has hazards, and its envelopes are those of its file."""
    workspace, run = exploration
    assert check_of(run, workspace).differences == ()
    folder = RunFolder.open(run)
    replay = replay_exploration(folder, workspace.manifest("toycar"))
    assert (replay.differences, replay.unfinished_count) == ((), 0)
    [envelope] = mutator.load_run(run, workspace=workspace).envelopes
    assert json.loads((run / ENVELOPES_FILE).read_text())["planes"] == [envelope.as_json()]
    assert {"H", "o"} <= set("".join(envelope.as_json()["cells"])) and envelope.validation


def test_an_exploration_that_was_cut_off_is_a_prefix(
    exploration: Explored, explored_run: Path, reseal: Reseal
) -> None:
    """Fewer batches, or a batch without all its records, are no difference: it is said that a plane is
    unfinished, and its envelope has what was driven.
    """
    workspace, manifest = exploration[0], exploration[0].manifest("toycar")
    run = explored_run
    batches = batches_of(run)
    write_batches(run, batches[:2])
    keep_records(run, [experiment.id for batch in batches[:2] for experiment in batch])
    reseal(run)
    cut = replay_exploration(RunFolder(run), manifest)
    assert cut.differences == () and cut.envelopes[0].run_count == sum(map(len, batches[:2]))
    assert cut.note == "unfinished: 1 plane is not searched to the end"
    keep_records(run, [experiment.id for experiment in batches[0]])
    reseal(run, finished=False)
    killed = replay_exploration(RunFolder(run), manifest)
    assert killed.differences == () and killed.envelopes[0].run_count == len(batches[0])
    assert check_of(run, workspace).differences == ()


@pytest.mark.usefixtures("without_figures")
@pytest.mark.parametrize("strategy", ["planes", "random"])
def test_a_search_is_replayed(
    exploration: Explored, tmp_path: Path, reseal: Reseal, strategy: Literal["planes", "random"]
) -> None:
    """Its proposals follow from its records, but not a moved border; the page begins with the findings."""
    workspace, run = exploration[0], tmp_path / "run"
    found = mutator.search(
        ["sensor/lane/shifted", "sensor/distance/longer"],
        "A",
        [0.5, 1.0],
        run,
        budget=24,
        strategy=strategy,
        longest_s=3.0,
        campaign="small",
        workspace=workspace,
    )
    assert check_of(run, workspace).differences == ()
    report = mutator.load_run(run, workspace=workspace).report()
    text = report.markdown.read_text()
    assert f"The search has {len(found)} finding" in text and "no share of them" in text
    page = report.page.read_text()
    assert all(f'href="#e={finding.result.experiment_id}"' in page for finding in found)
    assert (f'aria-label="{len(found)} findings after ' in page) is bool(found)
    first, second, *others = batches_of(run)
    write_batches(run, [first[:-1], [first[-1], *second], *others])
    reseal(run)
    assert check_of(run, workspace).differences


def test_a_worse_controller_has_a_smaller_envelope(
    exploration: Explored, tmp_path: Path, copy_toycar: Callable[[Path], Workspace]
) -> None:
    """One that steers harder leaves its lane at smaller errors: the gate names the plane and a run, and not
    in the other direction. A run compared with itself passes.
    """
    worse = copy_toycar(tmp_path)
    driver = worse.library.parent / "tree" / "toycar" / "driver.py"
    text = driver.read_text()
    driver.write_text(text.replace("-0.6 *", "-1.5 *"))
    assert driver.read_text() != text
    explore(worse, tmp_path / "run")
    runs = [
        mutator.load_run(path, workspace=workspace)
        for path, workspace in ((exploration[1], exploration[0]), (tmp_path / "run", worse))
    ]
    comparison = mutator.compare(*runs)
    assert "envelopes" in comparison.tables and not any(
        name.startswith("rates") for name in comparison.tables
    )
    [finding] = comparison.findings(["smaller-envelope"])
    assert "sensor/lane/shifted in A from 1 s" in finding.description
    record = runs[1].experiment(finding.experiment_id).record
    assert record and record.hazards
    assert comparison.tables["envelopes"]["became hazardous"].tolist() > [0]
    page = comparison.write(tmp_path / "compared").page.read_text()
    assert all(f'class="{name}"' in page for name in ("worse", "border before", "border after"))
    assert f"<code>{finding.experiment_id[:8]}</code>" in page
    assert mutator.compare(*reversed(runs)).findings(["smaller-envelope"]) == ()
    assert mutator.compare(runs[0], runs[0]).findings(["smaller-envelope"]) == ()


@pytest.mark.usefixtures("without_figures")
def test_random_searches_stand_beside_a_search(exploration: Explored, tmp_path: Path) -> None:
    """Those of the same planes in the folder of runs: the page draws them, and is built again without them.
    A search of other faults, and one that is damaged, are not shown; a random one stands alone.
    """
    workspace = exploration[0]

    def search(name: str, faults: list[str], **options: Any) -> mutator.Findings:
        out = tmp_path / name
        return mutator.search(
            faults, "A", 1.0, out, budget=12, longest_s=3.0, campaign="small", workspace=workspace, **options
        )

    faults = ["sensor/lane/shifted", "sensor/distance/longer"]
    found, drawn = search("search", faults), search("chance", faults, strategy="random", seed=3)
    search("other", faults[:1], strategy="random")
    search("damaged", faults, strategy="random", seed=4)
    shutil.rmtree(tmp_path / "damaged" / "records")
    report = mutator.load_run(tmp_path / "search", workspace=workspace).report(anew=True)
    page, text = report.page.read_text(), report.markdown.read_text()
    assert found and f"{len(found)} findings after 12 runs, drawn at random {len(drawn)}" in page
    assert f"After 12 runs: {len(found)}, and drawn at random {len(drawn)} (`chance`)" in text
    shutil.rmtree(tmp_path / "chance")
    audit = mutator.verify(tmp_path / "search", report=True, workspace=workspace)
    assert not any(check.differences for check in audit.checks)
    alone = mutator.load_run(tmp_path / "other", workspace=workspace).report(anew=True)
    assert "drawn at random" not in alone.page.read_text()


def test_run_json_and_plan_are_a_complete_chain(exploration: Explored, tmp_path: Path) -> None:
    """With these alone, a stranger computes the ids, the places in the plan and the digest of the batches
    again; an edit is found. (The plan digest also needs `campaign.yaml`, whose digest `run.json` has.)
    """
    genuine, stranger = RunFolder.open(exploration[1]), tmp_path / "stranger"
    shutil.copytree(genuine.path / "plan", stranger / "plan")
    shutil.copy(genuine.path / "run.json", stranger)
    folder = RunFolder.open_unverified(stranger)
    head = folder.head
    ids = {experiment.id for experiment in plan_file.iterate_experiments(stranger)}
    assert ids == genuine.records().keys() and len(ids) == head.experiments
    assert recomputed_chunks(folder) == tuple(map(tuple, head.chunks))
    assert not list(plan_file.batch_problems(stranger, head.experiments))
    assert plan_file.last_batch_digest(stranger) == mutator.seal(genuine.path).batches_digest
    path = stranger / plan_file.BATCHES_FILE
    first, *others = path.read_text().splitlines(keepends=True)
    path.write_text("".join([first.replace("batch 1", "batch 9"), *others]))
    [problem] = plan_file.batch_problems(stranger, head.experiments)
    assert problem.line == 2
