"""Pages of runs that a command works on, and of trials."""

import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mutator import try_fault
from mutator._common.folder_locks import lock_run_folder
from mutator.api.target_and_fault_selection import SelectedTarget
from mutator.model import Outcome
from mutator.serve.served_trials import _trigger_text
from mutator.store.run_progress import Progress
from mutator.store.session_progress import write_session_progress
from mutator.store.trial_file import StoredTrial
from mutator.workspace import Workspace

from .conftest import Client

HAZARD = {"outcome": Outcome.HAZARD, "hazards": (("H3", 4.0),)}


@pytest.fixture
def watching(
    tmp_path: Path,
    copy_toycar: Callable[[Path], Workspace],
    write_run: Callable[..., Path],
    served_at: Callable[[Workspace, Path], Any],
) -> Iterator[Client]:
    """A server with the run `half`, of which every second experiment has a record."""
    workspace = copy_toycar(tmp_path)
    shutil.rmtree(workspace.library / "faults" / "hostile")
    numbers = iter(range(1000))
    write_run(workspace, tmp_path / "runs" / "half", lambda _: HAZARD if next(numbers) % 2 else None)
    with served_at(workspace, tmp_path / "runs") as client:
        yield client


def test_a_run_in_progress_leads_to_its_live_page(watching: Client) -> None:
    """Its report does not exist yet."""
    run = watching.place / "runs" / "half"
    with lock_run_folder(run):
        write_session_progress(
            run, Progress(stage="experiments", done=6, total=12, per_s=2.0, remaining_s=3.0)
        )
        answer = watching.get("/runs/half/report/index.html")
        assert (answer.status, answer.headers["location"]) == (307, "/live/half")
        assert 'data-run="half"' in watching.get("/live/half").text
        data = watching.get("/api/runs/half/live?version=0").json
        [listed] = watching.get("/api/runs").json["runs"]
    assert (data["state"], data["stage"], data["rate"], data["rest"]) == (
        "running",
        "experiments",
        "2.0 a second",
        "3 s",
    )
    assert data["done"] == len(data["rows"]) == 12
    assert data["report"] is None
    assert (listed["state"], listed["stage"]) == ("running", "experiments")


def test_a_run_that_was_killed_before_it_had_tables_is_shown_from_its_records(watching: Client) -> None:
    """Its report answered with an error, and its list said 0."""
    assert watching.get("/runs/half/report/index.html").headers["location"] == "/live/half"
    data = watching.get("/api/runs/half/live").json
    [listed] = watching.get("/api/runs").json["runs"]
    assert (data["state"], data["done"], data["planned"]) == ("unfinished", 12, 24)
    assert (listed["state"], listed["done"]) == ("unfinished", 12)


def test_an_experiment_of_an_unfinished_run_is_shown(watching: Client) -> None:
    row = watching.get("/api/runs/half/live").json["rows"][0]
    page = watching.get(f"/live/half/{row['id']}")
    assert f'data-address="/api/runs/half/experiments/{row["id"]}"' in page.text
    data = watching.get(f"/api/runs/half/experiments/{row['id']}").json
    assert (data["id"], data["finished"]) == (row["id"], False)
    sentence = next(column for column in data["table"]["columns"] if column["name"] == "sentence")
    assert sentence["texts"] == [row["sentence"]]
    assert watching.get("/api/runs/half/experiments/0123456789abcdef").status == 404


@pytest.mark.parametrize(
    ("page", "reason"),
    [("/live/half", "no experiment &#39;0000000000000000&#39;"), ("/trial", "no such trial")],
)
def test_a_page_of_nothing_is_not_found(watching: Client, page: str, reason: str) -> None:
    """It says why, and is no empty page."""
    answer = watching.get(f"{page}/0000000000000000")
    assert (answer.status, reason in answer.text) == (404, True)


@pytest.mark.parametrize("version", ["-1", "x", "9" * 40, "1.5", "%C2%B2"])
def test_a_version_is_a_number(watching: Client, version: str) -> None:
    answer = watching.get(f"/api/runs/half/live?version={version}")
    assert (answer.status, answer.json["error"]["expected"]) == (400, "a whole number")


def test_a_run_that_is_still_planned_can_be_watched(watching: Client) -> None:
    new = watching.place / "runs" / "new"
    new.mkdir()
    assert watching.get("/live/new").status == 404
    with lock_run_folder(new):
        assert watching.get("/live/new").status == 200
        data = watching.get("/api/runs/new/live").json
        assert (data["state"], data["stage"]) == ("running", "plan")


@pytest.fixture
def trial(watching: Client) -> str:
    workspace, out = watching.site.workspace, watching.place / "runs" / "try"
    return try_fault("sensor/lane", "A", "2", value=2.4, workspace=workspace, out=out).experiment.id


@pytest.mark.slow
def test_a_trial_is_shown_as_long_as_its_target_is_the_same(watching: Client, trial: str) -> None:
    data = watching.get(f"/api/trials/{trial}").json
    assert data["range"] == {"low": 0.0, "high": 2.5, "step": 0.01, "unit": "m"}
    assert data["request"] == {
        "kind": "try",
        "spec": "sensor/lane",
        "variant": "shifted",
        "scenario": "A",
        "trigger": "2.0",
        "value": 2.4,
        "seed": 0,
        "reading": "as_described",
        "target": "toycar",
    }
    assert watching.get(f"/trial/{trial}").status == 200
    with (watching.place / "toy/tree/toycar/sensing.py").open("a") as file:
        file.write("# changed\n")
    answer = watching.get(f"/api/trials/{trial}")
    assert (answer.status, answer.json["error"]["got"]) == (400, "changed since this trial: target")


@pytest.mark.parametrize("text", ["always", "2.0", "near", "v_ego > 3.0"])
def test_the_trigger_of_a_trial_is_read_as_the_same_again(toycar: Workspace, text: str) -> None:
    """A time and a condition have names that `try` does not know."""
    selected = SelectedTarget.of(toycar)
    assert _trigger_text(selected.trigger(text)) == text


@pytest.mark.slow
def test_a_trial_that_was_changed_is_refused(watching: Client, trial: str) -> None:
    folder = watching.place / "runs" / "try" / trial
    stored = StoredTrial.read(folder)
    replace(stored, record=replace(stored.record, trace_digest="0" * 64)).write(folder)
    assert watching.get(f"/api/trials/{trial}").json["error"]["got"] == "the trace of another run"
    shutil.copytree(folder, folder.parent / ("0" * 16))
    assert watching.get(f"/api/trials/{'0' * 16}").json["error"]["got"] == f"the trial of {trial}"
    for text in ("{", "[]", '{"schema": "trial/1"}', '{"schema": "trial/1", "experiment": 1}'):
        (folder / "trial.json").write_text(text)
        assert watching.get(f"/api/trials/{trial}").status == 400
    (folder / "trial.json").unlink()
    (folder / "trial.json").symlink_to("/etc/passwd")
    assert watching.get(f"/api/trials/{trial}").status == 400


def test_the_live_page_of_a_pass_goes_on_while_mutator_watch_is_at_work(watching: Client) -> None:
    """After the next edit, another run takes the place of this one."""
    runs = watching.place / "runs"
    assert watching.get("/api/runs/half/live?version=0").json["is_followed"] is False
    with lock_run_folder(runs):
        assert watching.get("/api/runs/half/live?version=0").json["is_followed"] is True
