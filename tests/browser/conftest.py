"""A toy run with synthetic records, whose report opens in the system's Chromium. Every test fails on an error
in the browser's console."""

import os
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mutator._common.hashing import digest
from mutator.campaigns.plan import Plan, build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.model import Experiment, ObservedActivation, Outcome, Record, Status
from mutator.mutants.mutant_building import build
from mutator.outcomes.series_sampling import SeriesSampler, write_sampled_series
from mutator.report import report_builder
from mutator.report.panels import figures_panel
from mutator.results import table_building
from mutator.store.checksummed_lines import LineWriter
from mutator.store.packed_patches import PatchWriter
from mutator.store.records import RECORDS_SCHEMA
from mutator.store.run_folder import RunFolder
from mutator.store.series_format import encode_series
from mutator.store.series_packing import EncodedSeries, SeriesWriter, pack_series
from mutator.workspace import Workspace

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """A headless Chromium. Without Chromium or Playwright, the tests are skipped."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed (extra `test`)")
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.skip(f"no browser here: none of {', '.join(BROWSERS)} is on the PATH")
    flags = [*FLAGS, "--no-sandbox"] if os.geteuid() == 0 else [*FLAGS]
    with sync_api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=found, args=flags)
        yield started
        started.close()


def record(experiment: Experiment, number: int, patch: bytes) -> Record:
    status = {3: Status.HARNESS_ERROR, 4: Status.CRASHED}.get(number, Status.OK)
    active = number % 5 > 0
    hazard = status is Status.OK and number % 10 > 6
    outcome = Outcome.HAZARD if hazard else Outcome.SDC if active else Outcome.NOT_ACTIVATED
    return Record(
        experiment_id=experiment.id,
        status=status,
        outcome=outcome if status is Status.OK else None,
        detail="" if status is Status.OK else "<b>the disk</b> is gone",
        tree="f" * 64,
        activation=ObservedActivation(first=1.0 + number / 10, last=5.0, count=number) if active else None,
        t_manifest=1.5 + number / 10 if active else None,
        max_dev=(("gas", 0.3 if number in (1, 2, 7) else number / 7), ("brake", 0.0), ("wheel_turn", 0.0)),
        hazards=(("H3", 4.0 + number / 10),) if hazard else (),
        alerts=(("brake_hard", 3.0),) if hazard and number % 2 else (),
        trace_digest="f" * 64,
        patch=digest(patch),
    )


BuildRun = Callable[[Workspace, Path], tuple[Plan, RunFolder]]


def build_synthetic_run(workspace: Workspace, out: Path) -> tuple[Plan, RunFolder]:
    """Plan the campaign `toy`, and write synthetic records and the tables of its run folder."""
    plan = build_plan(workspace, "toy")
    folder = freeze_plan(plan, out, workspace)
    manifest, models = workspace.manifest("toycar"), workspace.fault_models()
    lines = LineWriter(
        folder.path / "records" / "0001-main.jsonl", {"schema": RECORDS_SCHEMA, "plan": plan.digest}
    )
    patches = PatchWriter(folder.path, "0001-main")
    for number, experiment in enumerate(plan.experiments):
        data = build(manifest, models, experiment.fault, experiment.trigger).patch_bytes
        lines.append(asdict(record(experiment, number, data)))
        patches.append(experiment.id, data)
    lines.close()
    patches.close()
    table_building.build_tables(folder.path)
    return plan, folder


@pytest.fixture(scope="session")
def build_run() -> BuildRun:
    return build_synthetic_run


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]) -> Path:
    """A run folder of 24 experiments with its report.

    The series of the second experiment is packed, and that of the third is in a separate file.
    """
    folder = tmp_path_factory.mktemp("browser")
    workspace = copy_toycar(folder)
    plan, out = build_synthetic_run(workspace, folder / "run")
    manifest = workspace.manifest("toycar")
    t = np.arange(0.0, 6.0, 0.05)
    names = ("gas", "brake", "wheel_turn", "gap", "speed")
    golden = {"time": t, **{name: np.sin(t + i) for i, name in enumerate(names)}}
    faulty = golden | {"gas": np.where(t < 2.0, golden["gas"], golden["gas"] + 0.3)}
    packed, kept = (record(experiment, 7, b"") for experiment in plan.experiments[1:3])
    sampler, writer = SeriesSampler(manifest, golden), SeriesWriter(out.path, "0001-main")
    data = encode_series(sampler.faulty_series(faulty, packed), sampler.golden)
    writer.append(
        packed.experiment_id,
        EncodedSeries(golden_key="A", golden_bytes=sampler.encoded_golden, faulty_bytes=data),
    )
    writer.close()
    pack_series(out.path, plan.digest, {packed.experiment_id: 0}, 1)
    write_sampled_series(out.path, manifest, golden, faulty, kept)
    with pytest.MonkeyPatch.context() as patch:  # figures take seconds and are tested elsewhere
        patch.setattr(figures_panel, "draw_figures", lambda frame: ())
        report_builder.write_report(out.path, None)
    return out.path


class Page:
    """An open report: Playwright's page, with steps that several tests share."""

    def __init__(self, page: Any, url: str) -> None:
        self.page = page
        self.url = url
        self.errors: list[str] = []
        page.on("console", lambda m: self.errors.append(m.text) if m.type in ("error", "warning") else None)
        page.on("pageerror", lambda error: self.errors.append(str(error)))

    def open(self, fragment: str = "") -> "Page":
        self.page.goto("about:blank")
        self.page.goto(f"{self.url}#{fragment}" if fragment else self.url)
        self.page.wait_for_selector("html[data-ready]")
        return self

    @property
    def fragment(self) -> str:
        return str(self.page.evaluate("location.hash.slice(1)"))

    @property
    def found(self) -> str:
        return str(self.page.inner_text("#found"))

    def column(self, name: str) -> list[str]:
        script = """name => {
            const heads = [...document.querySelectorAll('#grid th')];
            const rows = [...document.querySelectorAll('#grid tr[data-at]')];
            return rows.map((tr) => tr.cells[heads.findIndex((th) => th.dataset.column === name)].innerText);
        }"""
        return list(self.page.evaluate(script, name))

    def texts(self, selector: str) -> list[str]:
        return list(self.page.eval_on_selector_all(selector, "all => all.map((e) => e.textContent)"))

    def wait_for_rows(self, count: int) -> None:
        script = "n => document.querySelectorAll('#grid tr[data-at]').length === n"
        self.page.wait_for_function(script, arg=count)

    def choose(self, facet: str, value: str) -> None:
        self.page.click(f'[data-facet="{facet}"] > summary')
        self.page.click(f'[data-facet="{facet}"] .option:has-text("{value}")')
        self.page.keyboard.press("Escape")


Serve = Callable[..., AbstractContextManager[str]]


@pytest.fixture(scope="session")
def serve() -> Serve:
    pytest.importorskip("uvicorn", reason="extra `serve` is not installed")
    from mutator.serve.application import ServedSite
    from mutator.serve.request_security import HOST
    from mutator.serve.served_runs import ServedRuns
    from mutator.serve.server import build_server, open_listener

    @contextmanager
    def served(
        workspace: Workspace, runs: tuple[Path, ...] = (), *, port: int = 0, token: str = "t"
    ) -> Iterator[str]:
        site = ServedSite(workspace=workspace, runs=ServedRuns(runs))
        with open_listener(port) as listener:
            own = listener.getsockname()[1]
            server = build_server(site, port=own, token=token)
            thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
            thread.start()
            while not server.started:
                time.sleep(0.01)
            try:
                yield f"http://{HOST}:{own}/?token={token}"
            finally:
                server.should_exit = True
                thread.join(30)
                site.jobs.close()

    return served


@pytest.fixture
def visit(browser: Any) -> Iterator[Callable[..., Any]]:
    """Open an address as a separate visitor. An error in the console fails the test, unless the browser logs
    it for a failed request."""
    errors: list[str] = []
    contexts = []

    def opened(address: str, page: str = "", **options: Any) -> Any:
        contexts.append(browser.new_context(reduced_motion="reduce", **options))
        contexts[-1].set_default_timeout(20_000)
        shown = contexts[-1].new_page()
        shown.on("console", lambda m: errors.append(m.text) if m.type in ("error", "warning") else None)
        shown.on("pageerror", lambda error: errors.append(str(error)))
        shown.goto(address)
        if page:
            shown.goto(address.partition("/?")[0] + page)
        return shown

    yield opened
    for context in contexts:
        context.close()
    assert [text for text in errors if "Failed to load resource" not in text] == []


SERIOUS = """async () => {
    const found = await axe.run(document, { resultTypes: ["violations"] });
    const bad = found.violations.filter((v) => ["serious", "critical"].includes(v.impact));
    return bad.flatMap((v) => v.nodes.map((node) => `${v.id}: ${node.target} ${node.any[0]?.message || ""}`));
}"""


@pytest.fixture(scope="session")
def serious_faults() -> Callable[[Any], list[str]]:
    """Return a function that lists the serious accessibility faults that axe-core finds in a page."""
    package = pytest.importorskip("axe_playwright_python", reason="extra `test` is not installed")
    source = (Path(package.__path__[0]) / "axe.min.js").read_text(encoding="utf-8")

    def found(page: Any) -> list[str]:
        if not page.evaluate("typeof axe === 'object'"):
            page.evaluate(source)
        return list(page.evaluate(SERIOUS))

    return found


@pytest.fixture
def open_report(browser: Any) -> Iterator[Callable[[Path], Page]]:
    context = browser.new_context(viewport={"width": 1400, "height": 900}, reduced_motion="reduce")
    context.set_default_timeout(20_000)
    pages: list[Page] = []

    def open_it(run: Path) -> Page:
        pages.append(Page(context.new_page(), (run / "report" / "index.html").as_uri()))
        return pages[-1].open()

    yield open_it
    context.close()
    assert [page.errors for page in pages] == [[]] * len(pages)


@pytest.fixture
def page(open_report: Callable[[Path], Page], run: Path) -> Page:
    return open_report(run)
