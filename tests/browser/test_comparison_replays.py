"""The page of a comparison, from the verdict to both replays of an experiment."""

from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest

from mutator.comparison import comparison_files, comparison_replays
from mutator.comparison.run_comparison_and_gates import Comparison, compare_runs
from mutator.model import Experiment, Outcome
from mutator.outcomes.series_sampling import write_sampled_series
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

HAZARD = {"outcome": Outcome.HAZARD, "hazards": (("H1", 4.0),)}
TIMES = "() => [...document.querySelectorAll('.replay-player')].map((one) => one.dataset.t)"
Open = Callable[[Path], Any]


def silenced(e: Experiment) -> dict[str, Any]:
    return HAZARD if e.fault.fault_type == "silence" else {}


@pytest.fixture
def found(toycar: Workspace, tmp_path: Path, write_run: Callable[..., Path]) -> Comparison:
    """Two runs in which some experiments become hazards. Their series are kept; one run has a report."""
    # an address that would be a script, and text that would be markup, if they were not escaped
    names = ("javascript:alert(1) <img src=x onerror=alert(1)>", "after")
    before, after = write_run(toycar, tmp_path / names[0]), write_run(toycar, tmp_path / names[1], silenced)
    (before / "report").mkdir(exist_ok=True)
    (before / "report" / "index.html").write_text("<!doctype html><title>before</title>")
    manifest = toycar.manifest("toycar")
    for run, seconds in ((before, 6.0), (after, 4.0)):
        t = np.arange(0.0, seconds, 0.05)
        golden = {"time": t, **{name: np.sin(t) for name in ("gas", "brake", "wheel_turn", "gap", "speed")}}
        for record in RunFolder.open(run).records().values():
            by = dict(record.max_dev).get("gas", 0.0)
            faulty = golden | {"gas": np.where(t < 2.0, golden["gas"], golden["gas"] + by)}
            write_sampled_series(run, manifest, golden, faulty, record)
    return compare_runs(before, after)


@pytest.fixture
def opened(browser: Any) -> Any:
    """Open a page of a comparison alone. A request for another file, or an error, fails the test."""
    context = browser.new_context(viewport={"width": 1440, "height": 900}, reduced_motion="reduce")
    context.set_default_timeout(20_000)
    requests: list[str] = []
    errors: list[str] = []

    def open_page(path: Path) -> Any:
        page = context.new_page()
        page.on("console", lambda m: errors.append(m.text) if m.type in ("error", "warning") else None)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("dialog", lambda dialog: errors.append(dialog.message))

        def watched(route: Any) -> None:
            requests.append(route.request.url)
            route.continue_()

        page.route("**/*", watched)
        page.goto(path.as_uri())
        page.wait_for_selector("#pair[data-ready]")
        assert requests == [path.as_uri()]
        return page

    yield open_page
    context.close()
    assert errors == []


def test_the_page_leads_from_the_verdict_to_both_replays(
    found: Comparison, opened: Open, tmp_path: Path, serious_faults: Callable[[Any], list[str]]
) -> None:
    """Both play at once, although one drive is shorter. The statistics come after them."""
    page = opened(comparison_files.write_comparison(found, tmp_path / "out").page)
    changed = len(found.changed_pairs)
    assert (
        page.inner_text(".verdict").replace("\u00a0", " ")
        == f"Worse: {changed} of 24 experiments in both runs got worse."
    )
    tops = [
        page.locator(selector).first.bounding_box()["y"]
        for selector in (".verdict", "#changed", "#pair", "h2:text('What differs')")
    ]
    assert tops == sorted(tops)
    assert tops[1] < 500
    assert page.locator(".replay-player").count() == 2
    page.locator(".replay-player button.play").first.click()
    page.wait_for_function(
        "t => [...document.querySelectorAll('.replay-player')].every((one) => Number(one.dataset.t) > t)",
        arg=float(page.evaluate(TIMES)[0]),
    )
    page.locator(".replay-player [title^='To the end']").first.click()
    page.wait_for_function("() => [...document.querySelectorAll('.timebar')].every((e) => e.ariaValueNow)")
    first, second = page.evaluate(TIMES)
    assert first == second
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
        assert serious_faults(page) == []


def test_both_plots_have_the_line_of_the_other_run_over_them(
    found: Comparison, opened: Open, tmp_path: Path
) -> None:
    page = opened(comparison_files.write_comparison(found, tmp_path / "out").page)
    legends = page.locator(".plots .legend")
    assert legends.count() == 2
    assert legends.first.inner_text().endswith("after")
    assert found.names.a in legends.last.inner_text()
    plotted = page.locator(".plot-of .value.beside")
    assert plotted.count() >= 2
    assert all(text.strip() for text in plotted.all_inner_texts())


def test_the_page_links_to_the_reports_that_exist(found: Comparison, opened: Open, tmp_path: Path) -> None:
    """Names of runs can be hostile: they are neither markup nor a scheme of the address."""
    page = opened(comparison_files.write_comparison(found, tmp_path / "out").page)
    page.locator("#changed button.open").nth(1).click()
    page.wait_for_selector("#pair[data-ready='1']")
    before, after = (page.locator("#pair .sides > section").nth(number) for number in (0, 1))
    link = before.locator("a").evaluate("a => a.href")
    assert link.startswith(found.a.folder.path.resolve().as_uri()[:20])
    assert link.endswith(f"/report/index.html#e={found.changed_pairs[1].a.id}")
    assert "has no report yet" in after.inner_text()
    assert page.locator("main img").count() == 0


def test_the_page_says_which_changes_have_no_replay(
    found: Comparison, opened: Open, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(comparison_replays, "MOST_EMBEDDED_SERIES_BYTES", 100)
    page = opened(comparison_files.write_comparison(found, tmp_path / "out").page)
    page.locator("#changed button.open").last.click()
    page.wait_for_selector(f"#pair[data-ready='{len(found.changed_pairs) - 1}']")
    assert page.locator("#pair .replay-player").count() == 0
    assert "replays fill at most 0.0001 MB" in page.inner_text("#pair")


def test_the_server_shows_both_replays_and_links_to_both_reports(
    toycar: Workspace, found: Comparison, serve: Any, visit: Callable[..., Any]
) -> None:
    """Its rules for scripts and styles allow the page's."""
    runs = (found.a.folder.path, found.b.folder.path)
    with serve(toycar, runs) as address:
        page = visit(address, f"/compare/{quote(runs[0].name, safe='')}/after/")
        page.wait_for_selector("#pair[data-ready]")
        assert page.locator(".replay-player canvas").first.is_visible()
        assert page.locator(".replay-player").count() == 2
        page.locator("#pair .sides a").last.click()
        page.wait_for_selector("#experiment .replay-player")
        assert found.changed_pairs[0].b.id in page.inner_text("#experiment .id")
