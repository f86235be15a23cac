"""The first screen of a report: the worst experiment in words with its replay, four numbers, and the list."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from mutator._common.message_text import with_unbreakable_numbers
from mutator.outcomes.series_sampling import write_sampled_series
from mutator.report import report_builder
from mutator.report.panels import figures_panel
from mutator.results.table_reader import Results
from mutator.results.worst_first_ranking import worst_first_ranks
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace
from tests.browser.screens import on_each_screen

if TYPE_CHECKING:
    pass

TIME = "Number(document.querySelector('#worst-replay .replay-player').dataset.t)"


@pytest.fixture(scope="module")
def replayed(
    run: Path, tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]
) -> Path:
    """A copy of the run whose worst experiment has a series, with its report."""
    place = tmp_path_factory.mktemp("first")
    out = place / "run"
    shutil.copytree(run, out)
    folder, t = RunFolder.open(out), np.arange(0.0, 6.0, 0.05)
    golden = {"time": t, **{name: np.sin(t) for name in ("gas", "brake", "wheel_turn", "gap", "speed")}}
    worst = folder.records()[worst_id(out)]
    faulty = golden | {"gas": np.where(t < 2.0, golden["gas"], golden["gas"] + dict(worst.max_dev)["gas"])}
    write_sampled_series(out, copy_toycar(place).manifest("toycar"), golden, faulty, worst)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures_panel, "draw_figures", lambda frame: ())
        report_builder.write_report(out, None)
    return out


def worst_id(run: Path) -> str:
    results = Results(run).frame()
    return str(results["experiment_id"].iloc[int(worst_first_ranks(results).argmin())])


@pytest.fixture
def opened(browser: Any) -> Iterator[Callable[..., Any]]:
    """Open a report; requests are watched from the start, and an error in the console fails the test."""
    contexts, errors = [], list[str]()

    def open_it(run: Path, *, motion: str = "no-preference", fragment: str = "", **options: Any) -> Any:
        contexts.append(browser.new_context(reduced_motion=motion, **options))
        contexts[-1].set_default_timeout(20_000)
        page = contexts[-1].new_page()
        page.on("console", lambda m: errors.append(m.text) if m.type in ("error", "warning") else None)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.requests = []
        page.on("request", lambda request: page.requests.append(request.url.partition("#")[0]))
        page.goto((run / "report" / "index.html").as_uri() + fragment)
        page.wait_for_selector("html[data-ready]")
        return page

    yield open_it
    for context in contexts:
        context.close()
    assert errors == []


def test_the_worst_experiment_is_first_and_opens(replayed: Path, opened: Callable[..., Any]) -> None:
    page = opened(replayed, viewport={"width": 1440, "height": 900})
    page.wait_for_selector("#worst-replay .replay-player")
    rows = {row.experiment_id: row for row in Results(replayed).rows()}
    worst = rows[worst_id(replayed)]
    assert page.inner_text(".worst .fault") == with_unbreakable_numbers(worst.fault)
    assert page.inner_text(".worst h2") == with_unbreakable_numbers(worst.sentence or worst.fault)
    box = page.locator("#worst-replay .controls").bounding_box()
    assert box["y"] + box["height"] < 900, "the controls are not on the first screen"
    page.click(".worst a")
    assert page.evaluate("location.hash") == f"#e={worst.experiment_id}"
    page.wait_for_selector("#experiment .replay-player")
    assert page.inner_text("#experiment-title") == with_unbreakable_numbers(worst.sentence or worst.fault)


def test_the_replay_needs_no_other_file(replayed: Path, opened: Callable[..., Any]) -> None:
    page = opened(replayed)
    page.wait_for_selector("#worst-replay .replay-player")
    assert {*page.requests} == {(replayed / "report" / "index.html").as_uri()}


def test_the_replay_starts_by_itself_only_where_motion_is_allowed(
    replayed: Path, opened: Callable[..., Any]
) -> None:
    page = opened(replayed, viewport={"width": 1440, "height": 900})
    page.wait_for_selector("#worst-replay .replay-player")
    before = page.evaluate(TIME)
    page.wait_for_function(f"t => {TIME} > t", arg=before)
    page.click("#worst-replay .play")
    assert page.inner_text("#worst-replay .play").strip() == "Play"
    calm = opened(replayed, motion="reduce", viewport={"width": 1440, "height": 900})
    calm.wait_for_selector("#worst-replay .replay-player")
    before = calm.evaluate(TIME)
    calm.wait_for_timeout(700)  # longer than the time between frames with reduced motion
    assert calm.evaluate(TIME) == before
    calm.click("#worst-replay .play")
    calm.wait_for_function(f"t => {TIME} > t", arg=before)


def test_the_replay_pauses_while_an_experiment_is_open(replayed: Path, opened: Callable[..., Any]) -> None:
    page = opened(replayed, viewport={"width": 1440, "height": 900})
    page.wait_for_selector("#worst-replay .replay-player")
    page.click("#grid tr[data-at] >> nth=3")
    page.wait_for_function("document.querySelector('#worst-replay .play').textContent.includes('Play')")
    paused = page.evaluate(TIME)
    page.keyboard.press("Escape")
    page.wait_for_selector("#worst-replay .replay-player")
    assert page.evaluate(TIME) == paused


def test_an_address_with_an_open_experiment_loads_no_other_replay(
    replayed: Path, opened: Callable[..., Any]
) -> None:
    page = opened(replayed, fragment=f"#e={worst_id(replayed)}")
    page.wait_for_selector("#experiment .replay-player")
    assert page.locator("#worst-replay .replay-player").count() == 0
    page.keyboard.press("Escape")
    page.wait_for_selector("#worst-replay .replay-player")


def test_the_replay_is_built_only_in_view(replayed: Path, opened: Callable[..., Any]) -> None:
    """A page whose first screen is out of view builds no replay before its reader comes to it."""
    page = opened(replayed, viewport={"width": 1440, "height": 60})
    page.evaluate("new Promise((done) => setTimeout(done, 1500))")  # longer than a replay waits for idle time
    assert page.locator("#worst-replay > *").count() == 0
    page.locator("#worst-replay").scroll_into_view_if_needed()
    page.wait_for_selector("#worst-replay .replay-player")


def test_without_a_series_the_page_says_why(run: Path, opened: Callable[..., Any]) -> None:
    page = opened(run)
    page.wait_for_selector("#worst-replay p:text('series')")
    assert page.locator("#worst-replay canvas").count() == 0


def test_a_target_without_a_scene_shows_plots(replayed: Path, opened: Callable[..., Any]) -> None:
    page = opened(replayed)
    page.wait_for_selector("#worst-replay .plot-of canvas")
    assert page.locator("#worst-replay .plot-of").count() in (1, 2)
    assert page.locator("#worst-replay canvas.scene, #worst-replay .gauge").count() == 0


def test_numbers_have_intervals_and_lead_to_their_experiments(
    replayed: Path, opened: Callable[..., Any]
) -> None:
    page = opened(replayed)
    texts = page.locator(".key-numbers li").all_inner_texts()
    assert len(texts) == 4
    assert all("interval" in text for text in texts)
    page.click(".key-numbers li:nth-child(2) a")
    hazards = sum(row.ending == "hazard" for row in Results(replayed).rows())
    assert page.inner_text("#found") == f"{hazards} of 24 experiments"


@on_each_screen
def test_axe_finds_no_serious_fault_on_the_first_screen(
    replayed: Path,
    opened: Callable[..., Any],
    serious_faults: Callable[[Any], list[str]],
    width: int,
    scheme: str,
) -> None:
    page = opened(replayed, motion="reduce", viewport={"width": width, "height": 900}, color_scheme=scheme)
    page.wait_for_selector("#worst-replay .replay-player")
    assert serious_faults(page) == []
    assert page.evaluate("document.documentElement.scrollWidth") == width


def test_every_page_of_the_report_is_reachable_and_leads_back(
    replayed: Path, opened: Callable[..., Any], serious_faults: Callable[[Any], list[str]]
) -> None:
    page = opened(replayed)
    names = page.eval_on_selector_all(".bar a:not([href^='#'])", "all => all.map((a) => a.textContent)")
    assert names == ["Tables", "Origin"]
    for name in names:
        page.click(f".bar a:text-is('{name}')")
        assert name in page.inner_text("h1")
        assert serious_faults(page) == []
        page.click(".bar a:text-is('Report')")
        page.wait_for_selector("html[data-ready]")
