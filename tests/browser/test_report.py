"""The report page in the browser."""

import csv
import re
import shutil
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

import pytest
from scipy.stats import quantile_test

from mutator.report import report_builder
from mutator.report.panels import figures_panel
from mutator.store import plan_file
from mutator.store.packed_patches import PatchFolder
from mutator.store.run_folder import RunFolder
from mutator.store.time_series_folder import TimeSeriesFolder

from .conftest import record

if TYPE_CHECKING:
    from .conftest import Page

COUNT = 24
LOADED = """async ([id, trace, largest]) => {
    const series = await SeriesFile.load(id, {trace, largest});
    const words = (values) => [...new Uint32Array(values.buffer)];
    const channels = series.channels.map((channel) => (
        { ...channel, t: [...channel.t], golden: words(channel.golden), faulty: words(channel.faulty) }));
    return { ...series, channels };
}"""  # values as integers with the same bits


@pytest.fixture(scope="module")
def rows(run: Path) -> list[dict[str, str]]:
    with (run / "results.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_filters_select_rows_and_are_in_the_address(page: "Page", rows: list[dict[str, str]]) -> None:
    hazards = [row for row in rows if row["outcome"] == "hazard"]
    page.choose("outcome", "hazard")
    assert page.found == f"{len(hazards)} of {COUNT} experiments"
    assert set(page.column("ending")) == {"hazard"}
    page.choose("scenario", "B")
    both = [row for row in hazards if row["scenario"] == "B"]
    assert len(page.column("scenario")) == len(both) > 0
    assert page.fragment == "scenario=B&outcome=hazard"
    page.page.go_back()
    page.page.wait_for_function(
        "n => document.querySelectorAll('#grid tr[data-at]').length === n", arg=len(hazards)
    )
    page.page.fill("#search", hazards[0]["experiment_id"][:6])
    page.wait_for_rows(1)
    page.page.click(".chips .clear")
    assert page.found == f"{COUNT} experiments"


def test_a_click_on_a_column_title_sorts_with_empty_cells_last(
    page: "Page", rows: list[dict[str, str]]
) -> None:
    before = page.column("experiment_id")
    times = sorted(f"{float(row['t_activation']):.2f}" for row in rows if row["t_activation"])
    head = '#grid th[data-column="t_activation"]'
    page.page.click(f"{head} button")
    shown = page.column("t_activation")
    assert [float(t) for t in shown if t] == sorted(map(float, times))
    assert shown[len(times) :] == [""] * (COUNT - len(times))
    assert page.page.get_attribute(head, "aria-sort") == "ascending"
    page.page.click(f"{head} button")
    assert [float(t) for t in page.column("t_activation") if t] == sorted(map(float, times), reverse=True)
    page.page.click(f"{head} button")
    assert page.column("experiment_id") == before


def test_an_opened_experiment_shows_its_diff_spec_and_commands(page: "Page", run: Path) -> None:
    page.page.click("#grid tr[data-at] >> nth=0")
    page.page.wait_for_selector("#experiment .diff")
    name = page.fragment.removeprefix("e=")
    patch = (PatchFolder(run).read_patch(name) or b"").decode()
    tagged = [line[1:] for line in patch.splitlines() if line.startswith("+") and "# fi:" in line]
    injected = [line for line in tagged if "fi:probe" not in line and "fi:observe" not in line]
    for mode in ("Side by side", "Unified"):
        page.page.click(f"#experiment button:has-text('{mode}')")
        added = page.page.eval_on_selector_all(
            "#experiment .change .added code", "all => all.map((c) => c.textContent)"
        )
        assert added == injected
    assert "_fi.active" in page.page.inner_text("#experiment .snippet pre")
    assert "# fi:" not in page.page.inner_text("#experiment .snippet pre")
    assert "after_assign:" in page.page.inner_text("#experiment .spec pre")
    commands = page.page.eval_on_selector_all(
        "#experiment .command code", "all => all.map((c) => c.textContent)"
    )
    assert f"mutator rerun {name} --run {run}" in commands
    [again] = [command for command in commands if command.startswith("mutator try sensor/")]
    assert again.endswith(" --reading as_described"), "the command does not name the reading"
    page.page.go_back()
    page.page.wait_for_selector("#experiment", state="hidden")


def test_the_list_stays_next_to_an_opened_experiment(page: "Page") -> None:
    page.choose("outcome", "hazard")
    count, title = len(page.column("ending")), page.page.title()
    page.page.locator("#grid tr[data-at] >> nth=1").scroll_into_view_if_needed()
    before = page.page.evaluate("scrollY")
    page.page.click("#grid tr[data-at] >> nth=1")
    assert page.page.inner_text("#experiment .place") == f"2 of {count}"
    assert (
        page.page.title()
        == f"{page.page.inner_text('#experiment .fault')} in {page.column('scenario')[1]} - {title}"
    )
    boxes = [page.page.locator(name).bounding_box() for name in ("#grid", "#experiment")]
    assert boxes[0]["x"] + boxes[0]["width"] <= boxes[1]["x"], "the experiment is not beside the list"
    assert page.page.locator("#grid tr.open").get_attribute("data-at") == "1"
    page.page.click("#grid tr[data-at] >> nth=2")
    assert page.page.inner_text("#experiment .place") == f"3 of {count}"
    page.page.go_back()
    page.page.go_back()
    page.page.wait_for_selector("#experiment", state="hidden")
    assert page.page.title() == title
    assert page.page.evaluate("scrollY") == before > 100
    page.page.click("#grid tr[data-at] >> nth=1")
    page.page.click(".bar a:has-text('Summary')")
    assert not page.page.is_visible("#experiment")
    assert page.page.locator("#summary").is_visible()


def test_answers_link_to_their_experiments(page: "Page", rows: list[dict[str, str]]) -> None:
    hazards = [row for row in rows if row["outcome"] == "hazard"]
    silent = [row for row in hazards if not row["reaction_time"]]
    page.page.click(".dangerous td a >> nth=0")
    page.page.wait_for_selector("#experiment .ending.hazard")
    assert page.page.inner_text("#experiment .place") == f"1 of {len(hazards)}"
    page.page.go_back()
    page.page.click(".unwarned p a")
    assert page.page.inner_text(".unwarned p").startswith(f"{len(silent)} of {len(hazards)} hazards")
    assert page.found == f"{len(silent)} of {COUNT} experiments"
    assert len(silent) not in (0, len(hazards))


def test_the_list_starts_with_the_worst_experiment(page: "Page") -> None:
    endings = page.column("ending")
    assert endings == sorted(
        endings, key=["hazard", "crashed", "sdc", "not activated", "harness error"].index
    )
    page.open("cols=rank,kind")
    assert [int(text) for text in page.column("rank")] == list(range(1, COUNT + 1))


def test_a_link_with_an_unknown_filter_value_or_column_is_reported(page: "Page") -> None:
    page.open("alert=none")
    assert page.found == f'{COUNT} experiments. This page has no filter "alert"'
    page.open("scenario=Q")
    assert page.found == f'0 of {COUNT} experiments. No experiment has scenario "Q"'
    page.open("q=speeed%3E3")
    assert page.found == f'0 of {COUNT} experiments. There is no column "speeed" to search'


def test_none_can_be_used_in_filters_and_searches(page: "Page", rows: list[dict[str, str]]) -> None:
    without = sum(row["alerts"] == "" for row in rows)
    for fragment in ("alerts=none", "q=alerts%3Dnone"):
        page.open(fragment)
        assert page.found == f"{without} of {COUNT} experiments"
    assert 0 < without < COUNT


def test_terms_of_the_page_are_explained(page: "Page") -> None:
    page.page.click(".words summary")
    assert page.page.is_visible(".glossary")
    words = {"sdc", "masked", "golden run", "silent hazard", "guided", "rank", "near"}
    assert words <= {*page.texts(".glossary dt")}


def test_the_first_tab_stop_skips_to_the_list(page: "Page") -> None:
    page.page.keyboard.press("Tab")
    page.page.keyboard.press("Enter")
    assert page.page.evaluate("document.activeElement.dataset.at") == "0"


def test_series_are_loaded_from_their_files(page: "Page", run: Path, rows: list[dict[str, str]]) -> None:
    series = TimeSeriesFolder(run)
    assert series.index is not None
    names = {*series.index.entry_number_by_experiment, *series.rerun_ids()}
    planned = {experiment.id: experiment for experiment in plan_file.load_experiments(run)}
    assert len(names) == 2
    for name in names:
        page.open(f"e={name}")
        page.page.wait_for_selector("#experiment .replay-player")
        assert "H3" in page.page.inner_text("#experiment .replay")
        one = record(planned[name], 7, b"")
        known = [name, one.trace_digest, dict(one.max_dev)]
        found, read = page.page.evaluate(LOADED, known), series.load_series(name, one)
        assert read is not None
        golden, faulty = read
        assert [channel["name"] for channel in found["channels"]] == [
            "gas",
            "brake",
            "wheel_turn",
            "gap",
            "speed",
        ]
        for number, channel in enumerate(found["channels"]):
            one, other = golden.channel_values[number], faulty.channel_values[number]
            assert channel["t"] == golden.times_of(number).tolist()
            assert channel["golden"] == one.view("<u4").tolist()
            assert channel["faulty"] == other.view("<u4").tolist()
        assert found["marks"][-1] == ["hazard", pytest.approx(4.7), "H3"]
    page.open(f"e={next(row['experiment_id'] for row in rows if row['experiment_id'] not in names)}")
    page.page.wait_for_selector("#experiment .replay .command")
    assert "--trace" in page.page.inner_text("#experiment .replay .command")


def test_a_damaged_series_is_shown_with_the_command_that_restores_it(page: "Page", run: Path) -> None:
    name = TimeSeriesFolder(run).rerun_ids()[0]
    page.page.evaluate(
        "() => { SeriesFile.load = () => Promise.reject(new Error('series/x.js is damaged')); }"
    )
    page.page.evaluate("id => (location.hash = `e=${id}`)", name)
    page.page.wait_for_selector("#experiment .replay [role=alert]")
    said = page.page.inner_text("#experiment .replay")
    assert "series/x.js is damaged" in said
    assert f"mutator rerun {name} --trace --run {run}" in said


def test_a_cell_of_the_heat_map_filters_the_list(page: "Page", rows: list[dict[str, str]]) -> None:
    cell = '#heat button[aria-label^="sensor/lane in B:"]'
    here = [row for row in rows if (row["fault_type"], row["scenario"]) == ("lane", "B")]
    used = [row for row in here if row["status"] != "harness_error"]
    active = [row for row in used if row["t_activation"]]
    hazards = [row for row in active if row["outcome"] == "hazard"]
    assert page.page.inner_text(cell) == f"{len(hazards)}/{len(active)}"
    page.page.click(cell)
    assert page.found == f"{len(here)} of {COUNT} experiments"
    assert page.page.get_attribute(cell, "aria-pressed") == "true"
    page.page.select_option("#measure", "activated")
    assert page.page.inner_text(cell) == f"{len(active)}/{len(used)}"
    assert page.fragment == "kind=sensor%2Flane&scenario=B&heat=activated"
    page.page.click(cell)
    assert page.found == f"{COUNT} experiments"
    page.choose("outcome", "sdc")
    assert page.page.inner_text(cell) == f"{len(active)}/{len(used)}"
    page.choose("method", "guided")
    guided = [row for row in used if row["method"] == "guided"]
    assert page.page.inner_text(cell).endswith(f"/{len(guided)}")


MAP_CELL = """async ([measure, hasRates]) => {
    const table = new Rows.Table(await Packed.read("table"));
    const place = document.createElement("div"), picker = document.createElement("select");
    const state = { heat: measure, chosen: new Map(), set() {} };
    const metrics = [["t_activation", "s", "", "higher"]];
    const heat = new HeatMap(place, picker, table, state, { metrics, has_rates: hasRates });
    heat.show(table.filter("", new Map()).rows);
    const cell = place.querySelector('[aria-label^="all fault types in all scenarios"]');
    const options = [...picker.querySelectorAll("option")].map((o) => o.textContent);
    return [cell.textContent, cell.getAttribute("aria-label"), options];
}"""


def test_the_map_shows_the_median_of_a_metric(page: "Page", rows: list[dict[str, str]]) -> None:
    used = [row for row in rows if row["status"] != "harness_error"]
    times = [float(row["t_activation"]) for row in used if row["t_activation"]]
    text, about, options = page.page.evaluate(MAP_CELL, ["median-t_activation", True])
    assert float(text) == pytest.approx(median(times), rel=1e-2)
    ends = quantile_test(times, p=0.5).confidence_interval(0.95)
    assert f"({ends.low:.3g} to {ends.high:.3g}), over {len(times)}" in about
    assert options[-2:] == ["median t activation [s]", "worst t activation [s]"]


def test_where_counts_are_no_rates_the_map_has_neither_percentages_nor_intervals(page: "Page") -> None:
    abouts = {
        (measure, has_rates): page.page.evaluate(MAP_CELL, [measure, has_rates])[1]
        for measure in ("activated", "median-t_activation")
        for has_rates in (True, False)
    }
    assert re.search(r"\d+ of \d+, .* % \(", abouts["activated", True])
    assert re.search(r"\d+ of \d+$", abouts["activated", False])
    assert re.search(r"\d, over \d+$", abouts["median-t_activation", False])


def test_rows_of_the_map_with_nothing_to_count_are_named_and_left_out(
    page: "Page", rows: list[dict[str, str]]
) -> None:
    hazard = next(row for row in rows if row["outcome"] == "hazard")
    page.page.fill("#search", hazard["experiment_id"])
    page.wait_for_rows(1)
    kind = f"{hazard['module']}/{hazard['fault_type']}"
    assert page.texts("#heat th[scope=row]") == [kind, "all"]
    assert page.texts("#heat th[scope=col]") == [hazard["scenario"], "all"]
    others = {f"{row['module']}/{row['fault_type']}" for row in rows} - {kind}
    note = page.page.inner_text("#heat .omitted")
    assert note.startswith("Nothing to count: fault types ") and all(other in note for other in others)
    assert page.texts("#heat .cell") == ["1/1"] * 4


def test_columns_and_searches_are_in_the_address(page: "Page", rows: list[dict[str, str]]) -> None:
    page.page.click("summary:has-text('Columns')")
    page.page.check(".option:has-text('max dev gas') input")
    page.page.uncheck(".option:has-text('variant') input")
    page.page.keyboard.press("Escape")
    assert page.column("max_dev_gas")[0] != ""
    assert page.page.locator('#grid th[data-column="variant"]').count() == 0
    assert "max_dev_gas" in page.fragment and "cols=" in page.fragment
    page.page.fill("#search", "max_dev_gas>=1.5 scenario=b")
    fit = [r for r in rows if r["max_dev_gas"] and float(r["max_dev_gas"]) >= 1.5 and r["scenario"] == "B"]
    page.wait_for_rows(len(fit))
    assert 0 < len(fit) < COUNT
    page.page.click('#grid th[data-column="max_dev_gas"] button')
    shown, fragment = page.column("max_dev_gas"), page.fragment
    assert [float(text) for text in shown] == sorted(float(text) for text in shown)
    page.open(fragment)
    assert page.column("max_dev_gas") == shown
    page.page.click("summary:has-text('Columns')")
    page.page.click("text=Default columns")
    assert page.page.locator('#grid th[data-column="variant"]').count() == 1


def test_a_shared_link_restores_filter_order_and_experiment(page: "Page") -> None:
    page.choose("method", "guided")
    page.page.click('#grid th[data-column="scenario"] button')
    page.page.click("#grid tr[data-at] >> nth=2")
    shown, fragment = page.column("experiment_id"), page.fragment
    title = page.page.inner_text("#experiment h2")
    page.open(fragment)
    assert page.column("experiment_id") == shown
    assert page.page.inner_text("#experiment h2") == title
    page.open("e=0123456789abcdef")
    assert "No such experiment" in page.page.inner_text("#experiment")


def test_the_page_can_be_used_with_the_keyboard_alone(page: "Page") -> None:
    keys, focused = page.page.keyboard, "document.activeElement.dataset.at"
    keys.press("/")
    assert page.page.evaluate("document.activeElement.id") == "search"
    keys.press("Escape")
    keys.press("j")
    assert page.page.evaluate(focused) == "1"
    keys.press("ArrowDown")
    keys.press("k")
    keys.press("Enter")
    first = page.fragment
    assert first.startswith("e=")
    keys.press("j")
    second = page.fragment
    assert second != first
    keys.press("ArrowRight")  # a key of the open experiment, which still has the focus
    assert page.fragment not in (first, second)
    page.page.focus("#experiment header button >> nth=0")
    keys.press("Enter")
    keys.press("Enter")
    assert page.fragment == first
    keys.press("j")
    keys.press("Escape")
    assert page.fragment == ""
    assert page.page.evaluate(focused) == "2"
    keys.press("?")
    assert page.page.is_visible("#help")
    keys.press("Escape")
    assert not page.page.is_visible("#help")


def test_text_of_a_run_is_never_markup(page: "Page", rows: list[dict[str, str]]) -> None:
    crashed = next(row["experiment_id"] for row in rows if row["status"] == "crashed")
    page.open(f"e={crashed}")
    assert page.page.inner_text("#experiment .detail") == "<b>the disk</b> is gone"


def test_a_target_without_alerts_has_no_alert_column(
    page: "Page", run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = tmp_path / "run"
    shutil.copytree(run, other, ignore=shutil.ignore_patterns("report"))
    monkeypatch.setattr(RunFolder, "has_alerts", False)
    monkeypatch.setattr(figures_panel, "draw_figures", lambda frame: ())
    report_builder.write_report(other, None)
    told = [*page.texts("#grid th"), *page.texts("[data-facet] > summary"), *page.texts("option")]
    assert sum("alert" in text.lower() for text in told) >= 4
    page.url = (other / "report" / "index.html").as_uri()
    page.open("sort=-t_hazard")
    told = [*page.texts("#grid th"), *page.texts("[data-facet] > summary"), *page.texts("option")]
    assert len(told) > 15
    assert [text for text in told if "alert" in text.lower() or "reaction" in text] == []
    assert page.column("t_hazard")[0]
