"""The server serves only the files of reports."""

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import quote

import pytest

from mutator._common import cache_layout_and_pruning
from mutator.errors import MutatorError
from mutator.report import report_builder
from mutator.report.report_digests import inputs_digest, write_report_files
from mutator.results import table_building
from mutator.serve.http_responses import without_absolute_folders
from mutator.serve.page_tokens import PageTokens
from mutator.serve.report_and_comparison_pages import RunPages
from mutator.serve.report_cache import ReportCache
from mutator.serve.served_runs import ServedRuns
from mutator.store.run_folder import RunFolder
from mutator.store.series_script import script_bytes
from mutator.workspace import Workspace
from tests.made_up_results import write_results

from ..report.made_run import COLUMNS, LINES, make_run, make_two_runs
from .conftest import SECRET, Client

STEPS = ("..", "%2e%2e", "..%2f..", "%252e%252e", "....//..", "..%5c..", "%00", ".", "")
SECRETS = ("secret.csv", "runs/night/run.json")


@pytest.mark.parametrize(
    "address",
    [
        "/runs/{}",
        "/runs/night/{}",
        "/runs/night/report/{}",
        "/runs/night/plots/{}",
        "/runs/{}/report/index.html",
        "/assets/{}",
        "/compare/night/{}",
        "/compare/{}/night/",
        "/api/trials/{}",
        "/live/{}",
        "/live/night/{}/x",
        "/api/runs/{}/live",
        "/api/runs/night/experiments/{}",
        "/review/{}",
        "/api/review/{}",
        "/api/review/toycar?campaign={}",
        "/api/review/toycar/{}/changes",
        "/api/review/toycar/{}/typical?run=night",
        "/api/review/toycar/0123456789ab/typical?run={}",
        "/review/toycar/{}/picture/most-after.jpg",
        "/review/toycar/0123456789ab/picture/{}-after.jpg",
        "/api/jobs/{}/log",
    ],
)
def test_an_address_outside_the_reports_is_not_found(client: Client, address: str) -> None:
    ways = [f"{step}/" * 2 + secret for step in STEPS for secret in SECRETS]
    for way in (*ways, *map(str, (client.place / secret for secret in SECRETS)), "/etc/passwd"):
        for path in (address.format(way), address.format(quote(way, safe=""))):
            if str(client.place) in path:  # otherwise the response would echo the address of the request
                path = path.replace(str(client.place), quote(str(client.place), safe=""))
            answer = client.get(path)
            assert answer.status in (307, 400, 404), path
            assert "root:" not in answer.text and '"schema"' not in answer.text


@pytest.mark.parametrize("spec", ["../../secret.csv", "toy/fault_library/targets/toycar.yaml", "/etc/passwd"])
def test_a_spec_cannot_be_given_as_a_path(client: Client, spec: str) -> None:
    """Only the command line accepts a file."""
    for given in (spec, quote(spec, safe="")):
        answer = client.get(f"/api/review/toycar?spec={given}")
        assert answer.status in (400, 404)
        assert "root:" not in answer.text and '"schema"' not in answer.text


@pytest.mark.parametrize(
    "name",
    ["run.json", "digests.json", "campaign.yaml", "plan/faults.jsonl", "owner.lock", "report/made_from.json"],
)
def test_only_files_that_a_report_shows_are_served(client: Client, name: str) -> None:
    path = client.place / "runs/night" / name
    path.parent.mkdir(exist_ok=True)
    was_there = path.exists()
    if not was_there:
        path.write_text("{}")
    assert client.get(f"/runs/night/{name}").status == 404
    if not was_there:
        path.unlink()


def test_files_of_a_report_are_served(client: Client) -> None:
    assert client.get("/runs/night/results.csv").headers["content-type"].startswith("text/csv")
    picture = client.get(f"/runs/night/plots/{'0' * 16}-14.50s.jpg")
    assert (picture.headers["content-type"], picture.data) == ("image/jpeg", b"picture")
    film = client.place / "runs/night/plots" / f"{'0' * 16}.mp4"
    film.write_bytes(b"0123456789")
    part = client.get(f"/runs/night/plots/{film.name}", Range="bytes=2-4")
    assert (part.status, part.data) == (206, b"234")
    film.unlink()


@pytest.fixture
def linked(client: Client) -> Iterator[Path]:
    folder = client.place / "runs" / "linked"
    folder.mkdir()
    yield make_run(folder)
    shutil.rmtree(folder)


@pytest.mark.parametrize("name", ["plots/a.svg", "results.csv", "series/index.js", "series/kept/a.js"])
def test_a_link_to_a_file_is_not_followed(client: Client, linked: Path, name: str) -> None:
    path = linked / name
    path.parent.mkdir(parents=True, exist_ok=True)
    for end in (client.place / "secret.csv", linked / "plan.csv"):
        path.unlink(missing_ok=True)
        path.symlink_to(end)
        assert client.get(f"/runs/linked/{name}").status == 404


@pytest.mark.parametrize("name", ["plots", "report", "series"])
def test_linked_folders_are_not_followed(client: Client, linked: Path, name: str) -> None:
    """Otherwise, a report or a job could write into a linked folder."""
    outside = client.place / "outside"
    outside.mkdir(exist_ok=True)
    for kind in ("a.svg", "a.html", "index.js"):
        (outside / kind).write_text(SECRET)
    shutil.rmtree(linked / name, ignore_errors=True)
    (linked / name).symlink_to(outside)
    before = sorted(outside.iterdir())
    for path in (f"{name}/a.svg", f"{name}/a.html", f"{name}/index.js", "report/index.html"):
        assert client.get(f"/runs/linked/{path}").status in (400, 404)
    refused = client.post("/api/jobs", {"kind": "report", "run": "linked"})
    assert refused.status == 400
    assert refused.json["error"]["got"].startswith("a link")
    assert sorted(outside.iterdir()) == before
    assert not client.get("/api/jobs").json["jobs"]


@pytest.mark.parametrize("name", ["report/figures/a.svg", "records/a.jsonl", "series/kept/.a.js.1"])
def test_no_command_is_started_on_a_run_folder_with_a_link(client: Client, linked: Path, name: str) -> None:
    """Otherwise, the command's output would follow the link."""
    end = client.place / "secret.csv"
    (linked / name).parent.mkdir(parents=True, exist_ok=True)
    (linked / name).symlink_to(end)
    refused = client.post("/api/jobs", {"kind": "report", "run": "linked"})
    assert refused.status == 400
    assert refused.json["error"]["got"].startswith("a link")
    assert client.get("/runs/linked/report/index.html").status == 400
    assert client.get("/compare/linked/night/").status == 400
    assert end.read_text() == SECRET


def test_a_run_folder_that_is_a_link_is_not_served(client: Client) -> None:
    elsewhere = client.place / "elsewhere"
    elsewhere.mkdir()
    make_run(elsewhere)
    (client.place / "runs" / "link").symlink_to(elsewhere)
    assert "link" not in [run["key"] for run in client.get("/api/runs").json["runs"]]
    assert client.get("/runs/link/results.csv").status == 404


@pytest.mark.parametrize(
    "text",
    [
        "alert(1)",
        'SeriesFile.loaded("NAME","");alert(1);("");\n',
        'SeriesFile.loaded("NAME","a\\\\");alert(1);("");\n',
        'SeriesFile.loaded("NAME","a\nalert(1)//");\n',
        'SeriesFile.loaded("NAME","a");\nalert(1);\nSeriesFile.loaded("NAME","");\n',
        'SeriesFile.loaded("other","");\n',
        'SeriesFile.loaded("NAME",`${alert(1)}`);\n',
        'SeriesFile.loaded("NAME","\\x41");\n',
        'SeriesFile.loaded("NAME","");\n ',
    ],
)
@pytest.mark.parametrize("name", ["series/index.js", "series/kept/0123456789abcdef.js"])
def test_a_hostile_series_script_is_not_served(client: Client, name: str, text: str) -> None:
    """A series has the server's origin, so it is served only if it is one call with one plain string."""
    path = client.place / "runs/night" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text.replace("NAME", path.stem))
    assert client.get(f"/runs/night/{name}").status == 404
    path.unlink()


def test_series_are_served_unchanged(client: Client) -> None:
    """The page relies on the length in bytes, so the response is not encoded."""
    path = client.place / "runs/night/series/kept/0123456789abcdef.js"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(script_bytes(path.stem, bytes(range(256)) + b'");alert(1);("'))
    answer = client.get("/runs/night/series/kept/0123456789abcdef.js")
    assert (answer.status, answer.data) == (200, path.read_bytes())
    assert answer.headers["content-type"] == "application/javascript"
    path.unlink()


FORGED = "<body onload='alert(1)'><script src='/runs/linked/plots/a.svg'></script>"


@pytest.mark.parametrize("name", ["index.html", "study.html", "REPORT.md", "tables/a.csv", "figures/a.svg"])
def test_no_stored_report_is_served(client: Client, linked: Path, name: str) -> None:
    """Its stamp is valid."""
    path = linked / "report" / name
    path.parent.mkdir(parents=True)
    path.write_text(FORGED)
    write_report_files(
        linked, inputs_digest(RunFolder.open(linked), client.site.workspace), {name: FORGED.encode()}
    )
    answer = client.get(f"/runs/linked/report/{name}")
    assert answer.status == (200 if name in ("index.html", "REPORT.md") else 404)
    assert FORGED not in answer.text
    assert path.read_text() == FORGED


def test_a_report_is_built_once(client: Client, linked: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second server reads the cache. A damaged file in the cache is not used."""
    monkeypatch.setattr(client.site.run_pages, "_reports", ReportCache())
    first = client.get("/runs/linked/report/index.html").data
    assert not (linked / "report").exists()
    before = [path.name for path in cache_layout_and_pruning.cached_reports_folder().iterdir()]
    with monkeypatch.context() as patch:
        patch.setattr(report_builder, "build_report", None)
        assert client.get("/runs/linked/report/index.html").data == first
        monkeypatch.setattr(client.site.run_pages, "_reports", ReportCache())
        assert client.get("/runs/linked/report/index.html").data == first
    for name in before:
        page = cache_layout_and_pruning.cached_reports_folder() / name / "index.html"
        page.write_bytes(page.read_bytes().replace(b"</main>", b"</main><b>forged</b>"))
    monkeypatch.setattr(client.site.run_pages, "_reports", ReportCache())
    assert client.get("/runs/linked/report/index.html").data == first


def test_a_changed_run_gets_a_new_report(client: Client, linked: Path) -> None:
    before = client.get("/runs/linked/report/index.html").data
    write_results(linked, COLUMNS, [LINES[0] | {"t_h1": "18.26"}, *LINES[1:]])
    assert client.get("/runs/linked/report/index.html").data != before


def test_a_report_shows_the_change_against_the_run_before(client: Client) -> None:
    """As a stored report does, and anew when the run before changes."""
    runs = client.place / "runs"
    make_two_runs(runs)
    try:
        page = client.get("/runs/after/report/index.html").text
        assert "<b>Since the run before:</b> 1\u00a0new hazard, 1\u00a0gone" in page
        assert "Since the run before" not in client.get("/runs/before/report/index.html").text
        shutil.rmtree(runs / "before")
        assert "Since the run before" not in client.get("/runs/after/report/index.html").text
    finally:
        for name in ("before", "after"):
            shutil.rmtree(runs / name, ignore_errors=True)


def test_an_edited_table_is_not_shown_beside_the_seal_of_a_finished_run(
    toycar: Workspace, tmp_path: Path, write_finished: Callable[..., Path]
) -> None:
    table = table_building.build_tables(write_finished(toycar, tmp_path / "night"))
    shown = RunPages(toycar, ServedRuns((tmp_path,)), PageTokens(b"secret"))
    assert shown.run_file("night", "report/index.html").status_code == 200
    table.write_text(table.read_text().replace(",masked,", ",sdc,", 1))
    with pytest.raises(MutatorError, match=r"results\.csv:\d+: 'sdc'; expected 'masked'"):
        shown.run_file("night", "report/index.html")


@pytest.mark.parametrize(
    "name", ["plots/a.svg", "results.csv", "series/kept/0123456789abcdef.js", "report/REPORT.md"]
)
def test_other_files_of_a_run_cannot_act(client: Client, linked: Path, name: str) -> None:
    (linked / "plots/a.svg").write_text("<svg xmlns='http://www.w3.org/2000/svg'/>")
    (linked / "series/kept").mkdir(parents=True, exist_ok=True)
    script = linked / "series/kept/0123456789abcdef.js"
    script.write_bytes(script_bytes(script.stem, b"data"))
    answer = client.get(f"/runs/linked/{name}")
    assert answer.status == 200
    policy = answer.headers["content-security-policy"].split("; ")
    assert policy == ["default-src 'none'", "style-src 'unsafe-inline'", "sandbox"]
    assert answer.headers["x-content-type-options"] == "nosniff"


HOSTILE = "<img src=x onerror=alert(1)>"


def test_text_of_runs_is_escaped(client: Client) -> None:
    folder = client.place / "runs" / HOSTILE
    folder.mkdir()
    make_run(folder, campaign=HOSTILE)
    broken = client.place / "runs" / "broken"
    broken.mkdir()
    (broken / "run.json").write_text(json.dumps({"schema": HOSTILE}))
    try:
        home = client.get("/")
        assert HOSTILE not in home.text
        assert "&lt;img src=x onerror=alert(1)&gt;" in home.text
        key = quote(HOSTILE, safe="")
        assert f'href="/runs/{key}/report/index.html"' in home.text
        report = client.get(f"/runs/{key}/report/index.html")
        assert report.status == 200 and HOSTILE not in report.text
        for path in (f"/runs/{key}/nothing", f"/compare/{key}/night/", f"/review/{key}", f"/assets/{key}"):
            assert HOSTILE not in client.get(path).text
    finally:
        shutil.rmtree(folder)
        shutil.rmtree(broken)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("/srv/data/runs/a/run.json:12: no 'x'", "run.json:12: no 'x'"),
        ("cannot read '/srv/data/x.csv' (denied)", "cannot read 'x.csv' (denied)"),
        ("file:///srv/data/x.csv", "file://x.csv"),
        ("--- a/selfdrive/sim/radar.py +++ /dev/null", "--- a/selfdrive/sim/radar.py +++ /dev/null"),
        ("1.5 m/s and/or 3", "1.5 m/s and/or 3"),
    ],
)
def test_only_the_last_part_of_a_path_is_shown(text: str, told: str) -> None:
    assert without_absolute_folders(text) == told
