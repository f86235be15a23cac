"""The report as one file: it works alone in a folder, opened from disk."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mutator.outcomes.series_sampling import write_sampled_series
from mutator.report import report_builder, single_file_report
from mutator.report.panels import figures_panel
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

LINKS = """() => [...document.querySelectorAll("[href], [src]")]
    .map((e) => e.getAttribute("href") ?? e.getAttribute("src")).filter((link) => !/^(#|data:)/.test(link))"""
DRAWN = (
    "() => { const c = document.querySelector('canvas.scene, .plot-of canvas'); return c.width * c.height; }"
)


def ids(run: Path) -> tuple[str, str, str]:
    """Return two experiments whose series match their records, and another whose series does not."""
    experiments = plan_file.load_experiments(run)
    return experiments[7].id, experiments[2].id, experiments[1].id


@pytest.fixture
def written(
    run: Path, tmp_path: Path, copy_toycar: Callable[[Path], Workspace], monkeypatch: pytest.MonkeyPatch
) -> Callable[[], Path]:
    """Return a function that writes the single file of a copy of the run into an empty folder."""
    monkeypatch.setattr(figures_panel, "draw_figures", lambda frame: ())
    copy = tmp_path / "run"
    shutil.copytree(run, copy)
    folder, t = RunFolder.open(copy), np.arange(0.0, 6.0, 0.05)
    golden = {"time": t, **{name: np.sin(t) for name in ("gas", "brake", "wheel_turn", "gap", "speed")}}
    faulty = golden | {"gas": np.where(t < 2.0, golden["gas"], golden["gas"] + 0.3)}
    manifest, records = copy_toycar(tmp_path).manifest("toycar"), folder.records()
    for name in ids(copy)[:2]:
        write_sampled_series(copy, manifest, golden, faulty, records[name])
    (copy / "plots").mkdir(exist_ok=True)
    (copy / "plots" / f"{ids(copy)[0]}.mp4").write_bytes(b"film")  # a link in the page of the run folder

    def write() -> Path:
        built = report_builder.build_report(folder, None, single_file=True)
        assert built.single_file is not None
        path = tmp_path / "mailed" / "sent.html"
        path.parent.mkdir()
        path.write_bytes(built.single_file)
        return path

    return write


@pytest.fixture
def opened(browser: Any) -> Iterator[Callable[[Path, str], Any]]:
    """Open a page; a request for anything but the page, or an error in the console, fails the test."""
    context = browser.new_context(viewport={"width": 1400, "height": 900}, reduced_motion="reduce")
    context.set_default_timeout(20_000)
    requests: list[str] = []
    errors: list[str] = []

    def open_file(path: Path, fragment: str) -> Any:
        page = context.new_page()
        page.on("console", lambda m: errors.append(m.text) if m.type in ("error", "warning") else None)
        page.on("pageerror", lambda error: errors.append(str(error)))

        def watched(route: Any) -> None:
            requests.append(route.request.url)
            route.continue_()

        page.route("**/*", watched)
        page.goto(f"{path.as_uri()}#{fragment}")
        page.wait_for_selector("html[data-ready]")
        assert {url.partition("#")[0] for url in requests} <= {path.as_uri()}
        return page

    yield open_file
    asked = {url.partition("#")[0].rpartition("/")[2] for url in requests}
    context.close()
    assert (errors, asked - {"sent.html"}) == ([], set())


def test_the_file_alone_plays_its_replays_and_links_to_no_other_file(
    run: Path, written: Callable[[], Path], opened: Callable[[Path, str], Any]
) -> None:
    path = written()
    for name in ids(run)[:2]:
        page = opened(path, f"e={name}")
        page.wait_for_selector("#experiment .replay-player")
        assert page.evaluate(DRAWN) > 0
        before = float(page.get_attribute(".replay-player", "data-t"))
        page.click("#experiment button.play")
        page.wait_for_function(
            "t => Number(document.querySelector('.replay-player').dataset.t) > t", arg=before
        )
        assert page.evaluate(LINKS) == []
    assert "the replays of all experiments that have one: 2 experiments" in page.inner_text("#experiments")
    page = opened(path, f"e={ids(run)[2]}")
    page.wait_for_selector("#experiment .replay p:text('damaged or belongs to another run')")


def test_the_file_says_which_experiments_have_no_replay_inside(
    run: Path,
    written: Callable[[], Path],
    opened: Callable[[Path, str], Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(single_file_report, "MOST_EMBEDDED_SERIES_BYTES", 100)
    page = opened(written(), f"e={ids(run)[0]}")
    page.wait_for_selector("#experiment .replay p:text('replays of the worst experiments only')")
    assert page.locator("#experiment .replay button").count() == 0
    page.keyboard.press("Escape")
    note = page.inner_text("#experiments .listed")
    assert "Replays fill at most 0.0001 MB of it." in note
    [search] = [part for part in note.split() if part.startswith("rank>")]
    page.fill("#search", search)
    page.wait_for_function("() => document.getElementById('found').textContent.includes('of 24 ')")
