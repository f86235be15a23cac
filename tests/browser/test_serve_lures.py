"""Nothing on a page of a hostile run decides for the user, or reaches the jobs of other runs."""

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from mutator._common.hashing import digest
from mutator.report.panels import figures_panel
from mutator.report.report_digests import inputs_digest
from mutator.review.mutant_groups import groups_of_library
from mutator.review.review_page import review_page_html
from mutator.review.review_state_and_actions import load_review
from mutator.serve.job_queue import ServeJobs
from mutator.store import file_digests
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace
from tests.made_up_results import edit_results

pytestmark = pytest.mark.slow

REPORT = "/runs/night/report/index.html"
SVG = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100" onload="globalThis.hacked = true">
<script>globalThis.hacked = true</script>
<a href="/review/toycar"><rect width="100" height="100"/></a></svg>"""
HTML = (
    "<b onclick='hacked=1'>x</b><img src=x onerror='hacked=1'><a href='javascript:hacked=1'>go</a>"
    "</script><script>hacked=1</script><iframe src='/review/toycar'></iframe>"
)
LURE = "position: fixed; inset: 0; opacity: 0.01"
CLICKED = (
    "a, button, summary, input, select, label, tr, td, th, li, img, canvas, p, h1, h2, h3, svg, svg *, "
    "[tabindex]"
)
KEYS = ("j", "a", "r", "Shift+A", "Enter", "s", "Enter", "u", "f", " ", "Tab", "Enter")
CAMPAIGN = {"kind": "campaign", "campaign": "small", "name": "new"}
STARTED = [("campaign", "new", "queued"), ("report", "other", "queued")]


@pytest.fixture(scope="module")
def workspace(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    place = tmp_path_factory.mktemp("lures")
    shutil.copytree(run.parent / "toy", place / "toy")
    shutil.rmtree(place / "toy/fault_library/faults/hostile")
    return Workspace(library=place / "toy/fault_library", templates=place / "toy/templates")


@pytest.fixture(scope="module")
def runs(run: Path, workspace: Workspace) -> Path:
    """The hostile run `night` and another one."""
    place = workspace.library.parent.parent / "runs"
    shutil.copytree(run, place / "other")
    night = Path(shutil.copytree(run, place / "night"))
    head = json.loads((night / "run.json").read_text())
    head["campaign"] = HTML
    head["about_hazards"] = [one | {"about": HTML} for one in head["about_hazards"]]
    for component in (head["structure"] or {}).get("components", {}).values():
        component["about"] = component["label"] = HTML
    file_digests.rewrite_file(night, "run.json", json.dumps(head).encode())
    edit_results(night, "longer", HTML)
    (night / "plots").mkdir(exist_ok=True)
    lines = (night / "plan/experiments.jsonl").read_text().splitlines()
    first = json.loads(lines[1])["id"]
    for name in (f"{first}.svg", "javascript:alert(1).mp4", f"{first}-1.50s<b>.jpg"):
        (night / "plots" / name).write_text(SVG)
    report = night / "report"
    for name, text in stored_pages(workspace).items():
        (report / name).parent.mkdir(exist_ok=True)
        (report / name).write_text(text)
    (report / "made_from.json").unlink()
    files = {path.relative_to(report).as_posix(): digest(path.read_bytes()) for path in report.rglob("*.*")}
    inputs = inputs_digest(RunFolder.open(night), workspace)
    stamp = {"schema": "report/1", "made_from": inputs, "files": files}
    (report / "made_from.json").write_text(json.dumps(stamp))
    return place


def stored_pages(workspace: Workspace) -> dict[str, str]:
    """The review page under a lure: wherever the user clicks, all mutants are approved."""
    groups = groups_of_library(workspace, workspace.manifest("toycar"))
    served = {"target": "toycar", "by": "Jane", "api": "/api/review/toycar", "query": "", "runs": []}
    page = review_page_html(load_review(workspace, "toycar"), groups, [], served)
    for button in ("approve-shown", "ask-yes"):
        page = page.replace(f'id="{button}"', f'id="{button}" style="{LURE}"')
    page = page.replace("<body>", "<body><h1>Drive 12: click to play</h1>")
    return {"index.html": page, "study.html": page, "figures/a.svg": SVG, "a.html": page, "b.md": HTML}


@pytest.fixture
def address(
    workspace: Workspace, runs: Path, serve: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> Iterator[str]:
    """The address of a server whose jobs stay in the queue."""
    monkeypatch.setattr(figures_panel, "draw_figures", lambda frame: ())
    monkeypatch.setattr(ServeJobs, "_start_process", lambda jobs, job, events: None)
    with serve(workspace, (runs,)) as found:
        yield found


@pytest.fixture
def page(address: str, browser: Any, workspace: Workspace) -> Iterator[Any]:
    """The report of the hostile run. The first page has started a job of the other run and a campaign."""
    shutil.rmtree(workspace.library / "reviews", ignore_errors=True)
    context = browser.new_context(viewport={"width": 1400, "height": 900})
    context.set_default_timeout(20_000)
    page = context.new_page()
    page.goto(address)
    for order in (
        {"kind": "report", "run": "other"},
        {"kind": "campaign", "campaign": "small", "name": "new"},
    ):
        page.evaluate("order => Jobs.start(order)", order)
    page.goto(address.partition("/?")[0] + REPORT)
    yield page
    context.close()


def jobs_of_others(page: Any, address: str) -> list[tuple[str, str, str]]:
    jobs = page.request.get(address.partition("/?")[0] + "/api/jobs").json()["jobs"]
    return [(job["kind"], job["run"] or "", job["state"]) for job in jobs if job["run"] != "night"]


NEXT = """([selector, done]) => {
    for (const element of document.querySelectorAll(selector)) {
        const look = `${element.tagName} ${element.getAttribute("class")}`;
        const kind = `${look} ${element.textContent.slice(0, 20)}`;
        if (done.includes(kind)) continue;
        element.scrollIntoView({ block: "center" });
        const { x, y, width, height } = element.getBoundingClientRect();
        if (width && height) return [kind, x + Math.min(width / 2, 400), y + Math.min(height / 2, 300)];
    }
    return null;
}"""


def attack(page: Any, address: str) -> int:
    """Click each kind of element of a page, and press keys; return the number of clicks."""
    page.goto(address)
    page.wait_for_timeout(800)
    done: list[str] = []
    while len(done) < 400 and (found := page.evaluate(NEXT, [CLICKED, done])):
        kind, x, y = found
        done.append(kind)
        page.mouse.click(x, y)
        is_quick = address.endswith(REPORT) and not kind.startswith("A ")  # a link can be slow
        page.wait_for_timeout(20 if is_quick else 500)
        if page.url.partition("#")[0] != address:
            page.goto(address)
    for key in KEYS:
        page.keyboard.press(key)
    page.wait_for_timeout(500)
    return len(done)


@pytest.mark.parametrize(
    "name", ["report/index.html", "report/study.html", "report/a.html", "report/figures/a.svg", "plots/PLOT"]
)
def test_no_click_on_a_page_of_a_run_decides_or_reaches_other_jobs(
    page: Any, address: str, workspace: Workspace, runs: Path, name: str
) -> None:
    [plot] = (path.name for path in (runs / "night/plots").glob("*.svg"))
    clicks = attack(page, page.url.replace("report/index.html", name.replace("PLOT", plot)))
    assert clicks >= (50 if name == "report/index.html" else 1)
    assert not load_review(workspace, "toycar").entry_by_group
    assert jobs_of_others(page, address) == STARTED
    assert page.evaluate("globalThis.hacked") is None


SENT = "{ method: 'POST', body, headers: { 'content-type': 'application/json', 'x-mutator-page': token } }"
SCRIPTS = {
    "decide": f"async ([token, body]) => (await fetch('/api/review/toycar', {SENT})).status",
    "read the token of the review": "async () => (await fetch('/review/toycar')).status",
    "read the token of the first page": "async () => (await fetch('/')).status",
    "start a job of another run": "() => Jobs.start({kind: 'report', run: 'other'}).catch(() => 403)",
    "start a campaign": f"() => Jobs.start({json.dumps(CAMPAIGN)}).catch(() => 403)",
    "cancel a job of another run": "() => Jobs.ask('/api/jobs/1/cancel', {}).catch(() => 403)",
    "cancel a campaign": "() => Jobs.ask('/api/jobs/2/cancel', {}).catch(() => 403)",
}
FRAME = """async () => {
    const frame = Object.assign(document.createElement("iframe"), { src: "/review/toycar" });
    document.body.append(frame);
    await new Promise((done) => (frame.onload = done));
    return frame.contentDocument === null;
}"""
OWN_JOB = "() => Jobs.start({kind: 'report', run: 'night'}).then(() => 201, () => 403)"


def test_even_a_script_on_a_report_decides_nothing(page: Any, address: str, workspace: Workspace) -> None:
    groups = page.request.get(page.url.partition("/runs")[0] + "/api/review/toycar").json()["groups"]
    [group, *_] = groups
    body = {"changes": [{"group": group, "kind": "approve"}], "by": "Jane"}
    body |= {"seen": {group: groups[group]["revision"]}, "digests": {group: groups[group]["digest"]}}
    token = page.get_attribute('meta[name="mutator-page"]', "content")
    for what, script in SCRIPTS.items():
        assert page.evaluate(script, [token, json.dumps(body)]) == 403, what
    assert page.evaluate(FRAME)  # the browser shows an error page of no origin
    assert page.evaluate(OWN_JOB) == 201
    assert not load_review(workspace, "toycar").entry_by_group
    assert jobs_of_others(page, address) == STARTED


def test_a_review_ignores_input_that_was_meant_for_another_page(page: Any, workspace: Workspace) -> None:
    """Input in the first instants, clicks by scripts, and repeats of a held key."""
    page.clock.install(time=0)
    page.clock.pause_at(1000)
    page.goto(page.url.partition("/runs")[0] + "/review/toycar")
    button = page.locator(".marks button").first
    page.fill("#by", "Jane")
    page.evaluate("document.activeElement.blur()")
    for key in "jaAf":
        page.keyboard.press(key)
    button.click()
    assert not page.locator("#ask").is_visible()
    assert not page.evaluate("document.documentElement.hasAttribute('data-ready')")
    page.clock.run_for(600)
    page.wait_for_selector("html[data-ready]", state="attached")
    button.evaluate("button => button.click()")
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("j")
    for _ in range(6):
        page.keyboard.down("f")  # all but the first are repeats
    page.keyboard.up("f")
    page.wait_for_selector(".kept:text('saved')")
    [entry] = load_review(workspace, "toycar").entry_by_group.values()
    assert entry.decision is None and entry.flag is not None
