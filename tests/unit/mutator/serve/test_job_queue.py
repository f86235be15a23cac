"""Jobs, from the request to their files. All tests share one small campaign of the toy."""

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.report.panels import figures_panel
from mutator.serve.job_queue import JobState, ServeJob, ServeJobs
from mutator.serve.job_requests import JobCommand, RerunRequest
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

from .conftest import Client
from .test_files import HOSTILE
from .test_request_security import check_policy


@pytest.fixture(scope="module")
def busy(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    served_at: Callable[[Workspace, Path], Any],
) -> Iterator[Client]:
    place = tmp_path_factory.mktemp("busy")
    workspace = copy_toycar(place)
    shutil.rmtree(workspace.library / "faults" / "hostile")
    (place / "runs").mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures_panel, "draw_figures", lambda frame: ())
        with served_at(workspace, place / "runs") as client:
            order = {"kind": "campaign", "campaign": "small", "name": "first", "limit": 2, "workers": 1}
            answer = client.post("/api/jobs", order)
            assert (answer.status, answer.json) == (201, {"id": "1"})
            job = client.ended("1")
            assert job["state"] == "done", client.get("/api/jobs/1/log").json["log"]
            assert job["message"].startswith("outcomes: ")
            assert job["result"] == "/runs/first/report/index.html"
            yield client


def experiment(client: Client) -> str:
    return next(plan_file.experiment_ids(client.place / "runs/first"))


def test_shrinking_is_a_job_whose_result_is_an_experiment(busy: Client) -> None:
    """The address is that of the smallest form, in a served run of its own."""
    workspace = busy.site.workspace
    with mutator.open_bench(workspace, busy.place / "runs/lane", campaign="small") as bench:
        experiment = bench.build_experiment("sensor/lane/shifted", "A", 1.0, value=2.5)
        bench.run([experiment])
    answer = busy.post("/api/jobs", {"kind": "shrink", "run": "lane", "experiment": experiment.id})
    job = busy.ended(answer.json["id"])
    assert job["state"] == "done", busy.get(f"/api/jobs/{job['id']}/log").json["log"]
    assert "H3" in job["message"] and (job["run"], job["experiment"]) == ("lane", experiment.id)
    page, _, fragment = job["result"].partition("#")
    assert page == f"/runs/lane-{experiment.id}/report/index.html"
    name = fragment.partition("=")[2]
    shrunk = RunFolder.open(busy.place / "runs/shrunk" / f"lane-{experiment.id}")
    assert "H3" in dict(shrunk.records()[name].hazards)
    assert busy.get(page).status == 200


def test_the_run_of_a_job_is_complete_and_can_be_compared(busy: Client) -> None:
    assert RunFolder.open(busy.place / "runs/first").is_finished
    [run] = [run for run in busy.get("/api/runs").json["runs"] if run["key"] == "first"]
    assert (run["key"], run["state"], run["done"]) == ("first", "finished", 2)
    report = busy.get(run["report"])
    assert '<script src="/assets/serve/served.js" defer></script>\n</body>' in report.text
    compared = busy.get("/compare/first/first/")
    check_policy(compared)
    assert "Nothing: the same sources" in compared.text
    assert busy.get("/compare/first/first/pairs.csv").text.startswith("experiment_a,")
    assert busy.get("/compare/first/first/COMPARISON.md").status == 404
    log = busy.get("/api/jobs/1/log").json["log"]
    assert "2 of 2 experiments done" in log


@pytest.mark.slow
def test_an_exact_plot_is_stored_like_that_of_rerun(busy: Client) -> None:
    about = {"run": "first", "experiment": experiment(busy)}
    answer = busy.post("/api/jobs", {"kind": "plot", **about})
    job = busy.ended(answer.json["id"])
    assert (job["state"], job["message"]) == ("done", "the same as the campaign's record, byte for byte")
    assert job["result"] == f"/runs/first/report/index.html#e={experiment(busy)}"
    assert busy.get(f"/runs/first/plots/{experiment(busy)}.svg").headers["content-type"] == "image/svg+xml"
    assert RunFolder.open(busy.place / "runs/first").is_finished


@pytest.mark.slow
def test_a_try_is_stored_next_to_the_runs(busy: Client) -> None:
    order = {"kind": "try", "spec": "sensor/lane", "scenario": "A", "trigger": "2", "value": 2.4}
    job = busy.ended(busy.post("/api/jobs", order).json["id"])
    assert job["state"] == "done", busy.get(f"/api/jobs/{job['id']}/log").json
    assert job["message"].startswith("verdict: ")
    trial = job["result"].removeprefix("/trial/")
    data = busy.get(f"/api/trials/{trial}").json
    assert (data["id"], data["request"]["value"], data["range"]["high"]) == (trial, 2.4, 2.5)
    assert data["series"]["of"] == {trial: [0, 1]}
    assert [run["key"] for run in busy.get("/api/runs").json["runs"]] == ["first"]


def test_jobs_wait_and_are_cancelled_without_leaving_a_process(busy: Client) -> None:
    order = {"kind": "campaign", "campaign": "toy", "name": "second", "limit": 20, "workers": 2}
    first, second = (busy.post("/api/jobs", order).json["id"] for _ in range(2))
    states = {job["id"]: job["state"] for job in busy.get("/api/jobs").json["jobs"]}
    assert states[second] == "queued"
    for name in (second, first):
        assert busy.post(f"/api/jobs/{name}/cancel", {}).status == 200
    for name in (first, second):
        job = busy.ended(name)
        assert (job["state"], job["result"]) == ("cancelled", None)
        assert busy.post(f"/api/jobs/{name}/cancel", {}).status == 409
    assert busy.post("/api/jobs/99/cancel", {}).status == 404
    assert busy.get("/api/jobs/99/log").status == 404


@pytest.mark.slow
def test_a_failed_job_gives_the_reason(busy: Client) -> None:
    target = busy.place / "toy/tree/toycar/sensing.py"
    whole = target.read_text()
    target.write_text(whole + "# changed\n")
    answer = busy.post("/api/jobs", {"kind": "rerun", "run": "first", "experiment": experiment(busy)})
    job = busy.ended(answer.json["id"])
    target.write_text(whole)
    assert job["state"] == "failed"
    assert "run.json" in job["message"] or "target" in job["message"]


def job(**given: Any) -> ServeJob:
    order = RerunRequest(kind="rerun", run="first", experiment="0" * 16)
    return ServeJob(id="1", job_command=JobCommand(job_request=order, title="again", argv=()), **given)


def test_the_output_of_a_job_is_plain_text() -> None:
    made = job()
    hostile = f"\x1b[31m/srv/data/{HOSTILE}\x07\u202e"
    made.add_output(f"{hostile}\n".encode())
    made.add_output(b"\xff\xfe\n")
    assert made.log_text == f"{HOSTILE}\n\ufffd\ufffd\n"
    made.add_output(b"x" * 300_000)
    assert len(made.log_text) == 100_000
    made.add_events(event("warning", text=hostile))
    assert made.message == f"warning: {HOSTILE}"
    made.add_events(event("phase", phase="x" * 9_999, done=0, total=0, outcomes={}))
    assert len(made.message) == 500


def event(kind: str, **facts: Any) -> bytes:
    return json.dumps({"event": kind, **facts}).encode() + b"\n"


def test_a_job_reports_the_progress_of_its_phase() -> None:
    made = job()
    made.add_events(event("phase", phase="experiments", done=1, total=4, outcomes={"sdc": 1}))
    assert (made.progress, made.message) == (0.25, "experiments 1/4, sdc 1")
    made.add_events(event("phase", phase="report", done=0, total=0, outcomes={}))
    assert (made.progress, made.message) == (None, "report")


def test_the_state_of_a_job_does_not_depend_on_its_output() -> None:
    """A fault's name, or what a target prints, can look like any sentence."""
    made = job()
    made.add_output(b"error: none\nexperiments 3/4\nverdict: hazard\nplot: /tmp/plot.svg\n")
    assert (made.progress, made.message, made.result_text, made.error_text, made.path_by_kind) == (
        None,
        "",
        "",
        "",
        {},
    )


def test_events_arrive_in_any_pieces_and_other_lines_are_dropped() -> None:
    made = job()
    wrong = (
        b"nonsense\n",
        b"\xff\n",
        event("result"),
        event("phase", phase="x", done=-1, total=0, outcomes={}),
    )
    for line in (*wrong, event("result", text="wrong", more=1), b"x" * 99_999 + b"\n"):
        made.add_events(line)
    for byte in event("result", text="verdict: sdc"):
        made.add_events(bytes([byte]))
    assert (made.result_text, made.message) == ("verdict: sdc", "")


def test_the_number_of_waiting_jobs_is_limited() -> None:
    """Without a limit, a page could fill the memory."""
    jobs = ServeJobs(0, lambda work: None)
    for _ in range(50):
        assert jobs.submit(job().job_command).state is JobState.QUEUED
    with pytest.raises(MutatorError, match="50 jobs are waiting"):
        jobs.submit(job().job_command)
    jobs.close()
