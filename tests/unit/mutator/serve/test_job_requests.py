"""Requests for jobs are checked before anything starts."""

import math
from pathlib import Path
from typing import Any

import pytest

from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.errors import MutatorError
from mutator.serve.job_queue import ServeJobs
from mutator.serve.job_requests import JobCommand, RequestChecker
from mutator.serve.live_and_trial_pages import WatchPages
from mutator.serve.page_tokens import PageTokens
from mutator.serve.served_runs import ServedRuns
from mutator.store import plan_file
from mutator.workspace import Workspace

from .conftest import Client

TRY = {"kind": "try", "spec": "sensor/lane", "scenario": "A"}
CAMPAIGN = {"kind": "campaign", "campaign": "small", "name": "new"}
ABSENT = "0" * 16


@pytest.mark.parametrize(
    "order",
    [
        {},
        {"kind": "shell"},
        {"kind": "rerun"},
        {"kind": "rerun", "run": "night", "experiment": ABSENT},
        {"kind": "rerun", "run": "night", "experiment": "00"},
        {"kind": "rerun", "run": "night", "experiment": "--help"},
        {"kind": "rerun", "run": "night", "experiment": ABSENT, "words": ["rm"]},
        {"kind": "rerun", "run": "../night", "experiment": ABSENT},
        {"kind": "rerun", "run": ["night"], "experiment": ABSENT},
        {"kind": "still", "run": "night", "experiment": ABSENT, "t": "1=/tmp/x.png"},
        {"kind": "still", "run": "night", "experiment": ABSENT, "t": -1},
        {"kind": "report", "run": "no such"},
        {"kind": "report", "run": "/etc"},
        {"kind": "report", "run": "--root=/"},
        TRY | {"spec": "../../secret.yaml"},
        TRY | {"spec": "toy/fault_library/faults/sensor/lane.yaml"},
        TRY | {"spec": "-sensor/lane"},
        TRY | {"spec": "sensor/*"},
        TRY | {"spec": ""},
        TRY | {"scenario": "/etc/passwd"},
        TRY | {"scenario": "../targets/toycar.yaml"},
        TRY | {"scenario": "--out=/tmp/x"},
        TRY | {"variant": "none such"},
        TRY | {"variant": "-v"},
        TRY | {"value": "1"},
        TRY | {"value": 2.51},
        TRY | {"value": -1e300},
        TRY | {"spec": "sensor/silence", "value": 1},
        TRY | {"seed": -1},
        TRY | {"seed": 2**70},
        TRY | {"seed": True},
        TRY | {"reading": "other"},
        TRY | {"target": "../toycar"},
        TRY | {"trigger": "__import__('os').system('id')"},
        TRY | {"trigger": "unknown > 1"},
        TRY | {"trigger": "nan"},
        TRY | {"trigger": "-5"},
        TRY | {"trigger": "always\n--out=/tmp/x"},
        TRY | {"trigger": "t > 1" + " and t > 1" * 1000},
        TRY | {"out": "/tmp/x"},
        CAMPAIGN | {"campaign": "../campaigns/small"},
        CAMPAIGN | {"campaign": "small.yaml"},
        CAMPAIGN | {"name": ".."},
        CAMPAIGN | {"name": "../new"},
        CAMPAIGN | {"name": "/tmp/new"},
        CAMPAIGN | {"name": ".hidden"},
        CAMPAIGN | {"name": "-n"},
        CAMPAIGN | {"name": "a\n"},
        CAMPAIGN | {"name": "a" * 65},
        CAMPAIGN | {"limit": 0},
        CAMPAIGN | {"limit": 100_000},
        CAMPAIGN | {"workers": 0},
        CAMPAIGN | {"only": "__import__('os')"},
        CAMPAIGN | {"only": "--cluster=tcp://evil"},
        CAMPAIGN | {"cluster": "tcp://evil"},
        b"",
        b"[]",
        b"{",
        b'{"kind": "try", "value": NaN}',
        b"[" * 100_000,
        b"\xff\xfe",
    ],
)
def test_a_hostile_request_starts_no_job(client: Client, order: Any) -> None:
    answer = client.ask("POST", "/api/jobs", body=order)
    assert answer.status in (400, 404), answer.text
    assert answer.json["error"]["got"]
    assert client.get("/api/jobs").json == {"jobs": []}


@pytest.mark.parametrize(
    "kind", ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data", ""]
)
def test_a_job_request_must_be_json(client: Client, kind: str) -> None:
    """A form on another site cannot send JSON."""
    assert client.ask("POST", "/api/jobs", {"Content-Type": kind}, TRY).status == 415
    assert client.get("/api/jobs").json == {"jobs": []}


@pytest.fixture
def desk(toycar: Workspace, tmp_path: Path) -> RequestChecker:
    (tmp_path / "runs").mkdir()
    freeze_plan(build_plan(toycar, "small"), tmp_path / "runs" / "first", toycar)
    return RequestChecker(toycar, ServedRuns((tmp_path / "runs",)))


def work(desk: RequestChecker, **order: Any) -> JobCommand:
    import json

    return desk.build_command(json.dumps(order).encode())


def test_requests_become_command_lines(desk: RequestChecker) -> None:
    run = desk.runs.folder("first")
    experiment = next(plan_file.experiment_ids(run))
    place = (f"--library={desk.workspace.library}", f"--templates={desk.workspace.templates}")
    about = {"run": "first", "experiment": experiment}
    of_run = (f"--run={run}", *place)
    assert work(desk, kind="rerun", **about).argv == ("rerun", experiment, *of_run)
    assert work(desk, kind="plot", **about).argv == ("rerun", experiment, "--trace", *of_run)
    film = f"--video={run}/plots/{experiment}.mp4"
    assert work(desk, kind="film", **about).argv == ("show", experiment, film, *of_run)
    shrunk = work(desk, kind="shrink", **about)
    out = f"--out={run.parent}/shrunk/first-{experiment}"
    assert (shrunk.argv, shrunk.result_address) == (("shrink", experiment, out, *of_run), None)
    still = work(desk, kind="still", t=3, **about)
    assert still.argv == ("show", experiment, "--still=3.00", *of_run)
    assert still.result_address == f"/runs/first/report/index.html#e={experiment}"
    assert work(desk, kind="report", run="first").argv == ("report", str(run), *place)
    given = {"value": 2.25, "seed": 3, "variant": "shifted", "trigger": "v_ego > 3"}
    options = ("--scenario=A", "--trigger=v_ego > 3", "--variant=shifted", "--value=2.25", "--seed=3")
    assert work(desk, **TRY, **given).argv == (
        "try",
        "sensor/lane",
        *options,
        f"--out={run.parent}/try",
        *place,
    )
    words = work(desk, **CAMPAIGN, only="scenario == 'A'", workers=1).argv
    options = (f"--out={run.parent}/new", "--limit=20", "--only=scenario == 'A'", "--workers=1")
    assert words == ("run", "small", *options, *place)
    words = work(desk, **CAMPAIGN, proportional=True, workers=1).argv
    assert words == ("run", "small", options[0], options[1], options[3], "--proportional", *place)


def test_a_value_outside_of_the_declared_range_is_refused_in_words(desk: RequestChecker) -> None:
    with pytest.raises(MutatorError, match=r"the value 9; expected 0 to 2\.5 m"):
        work(desk, **TRY, value=9)


@pytest.mark.parametrize("trigger", ["always", "10", "1.5", "near", "near_far/near", "t >= 2 and v_ego > 3"])
def test_a_trigger_becomes_an_option_of_try(desk: RequestChecker, trigger: str) -> None:
    assert f"--trigger={trigger}" in work(desk, **TRY, trigger=trigger).argv


def test_a_new_run_cannot_be_a_link(desk: RequestChecker, tmp_path: Path) -> None:
    (tmp_path / "runs" / "new").symlink_to(tmp_path)
    with pytest.raises(MutatorError, match="a link"):
        work(desk, **CAMPAIGN)
    (tmp_path / "runs" / "try").symlink_to(tmp_path)
    with pytest.raises(MutatorError, match="a link"):
        work(desk, **TRY)


def test_a_new_run_cannot_take_the_addresses_of_a_run_in_another_folder(
    desk: RequestChecker, toycar: Workspace, tmp_path: Path
) -> None:
    """Open pages of the other run would read the new one's results."""
    freeze_plan(build_plan(toycar, "small"), tmp_path / "old" / "new", toycar)
    runs = ServedRuns((*desk.runs.roots, tmp_path / "old"))
    with pytest.raises(MutatorError, match="a run 'new' in another folder"):
        work(RequestChecker(toycar, runs), **CAMPAIGN)


def test_a_job_is_shown_for_its_own_run_only(desk: RequestChecker, toycar: Workspace, tmp_path: Path) -> None:
    """A run of the same name in another folder is another run."""
    runs = ServedRuns((*desk.runs.roots, tmp_path / "old"))
    jobs = ServeJobs(0, lambda _: None)  # none of them begins
    command = work(RequestChecker(toycar, runs), **CAMPAIGN)
    assert command.run_folder == tmp_path / "runs" / "new"
    freeze_plan(build_plan(toycar, "small"), tmp_path / "old" / "new", toycar)
    pages = WatchPages(toycar, runs, jobs, PageTokens(b"secret"))
    job = jobs.submit(command)
    assert pages._job_of("new") is job
    assert runs.folders_by_key()["new-2"] == tmp_path / "old" / "new"
    assert pages._job_of("new-2") is None


def test_an_infinite_number_is_refused(desk: RequestChecker) -> None:
    with pytest.raises(ValueError):
        work(desk, **TRY, value=math.inf)


def test_a_campaign_that_explores_runs_whole(desk: RequestChecker) -> None:
    """Its experiments follow from results, so no number and no filter can choose among them."""
    text = (desk.workspace.library / "campaigns/small.yaml").read_text()
    text = text[: text.index("faults:")].replace("name: small", "name: explored")
    canary = "canary: {spec: sensor/lane/shifted, scenario: A, hazard: H3, at_s: 1.0}"
    explored = f"{text}faults: [{{spec: sensor/lane/shifted}}]\nexplore: {{starts: [1]}}\nseed: 3\n{canary}\n"
    (desk.workspace.library / "campaigns/explored.yaml").write_text(explored)
    order = {"kind": "campaign", "campaign": "explored", "name": "new"}
    words = work(desk, **order, workers=1, proportional=True).argv
    assert "--proportional" not in words
    assert words[:4] == ("run", "explored", f"--out={desk.runs.folder('first').parent}/new", "--workers=1")
    with pytest.raises(MutatorError, match="a filter for explored, which explores"):
        work(desk, **order, only="scenario == 'A'")


def test_smaller_forms_are_no_link_elsewhere(desk: RequestChecker, tmp_path: Path) -> None:
    """A run that somebody else made can have a link beside it."""
    run = desk.runs.folder("first")
    experiment = next(plan_file.experiment_ids(run))
    (tmp_path / "elsewhere").mkdir()
    (run.parent / "shrunk").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(MutatorError, match="shrunk is a link"):
        work(desk, kind="shrink", run="first", experiment=experiment)
