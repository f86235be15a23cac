"""The replay of an experiment."""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from .conftest import Page

# A car hits the one ahead at 4 s because a fault prevents braking from 2 s on.
STEPS, DT, BEGIN, END = 121, 0.05, 2.0, 4.0
TIMES = [i * DT for i in range(STEPS)]
SPEED = {"golden": [20.0 - 4.0 * max(0.0, t - BEGIN) for t in TIMES], "faulty": [20.0 for _ in TIMES]}
GAP = {
    "golden": [40.0 - 5.0 * t for t in TIMES],
    "faulty": [40.0 - 5.0 * t - (7.5 * (t - BEGIN) ** 2 if t > BEGIN else 0.0) for t in TIMES],
}
BRAKE = {"golden": [min(1.0, max(0.0, t - BEGIN)) for t in TIMES], "faulty": [0.0 for _ in TIMES]}
CALM = {"golden": [math.sin(t) for t in TIMES], "faulty": [math.sin(t) for t in TIMES]}
SERIES = {
    "id": "0" * 16,
    "start": 0.0,
    "end": TIMES[-1],
    "tEnd": END,
    "active": [BEGIN, 5.5],
    "marks": [
        ["activation", BEGIN, "activated"],
        ["manifest", 2.05, "manifested"],
        ["alert", 3.0, "brake_hard"],
        ["hazard", END, "H1"],
    ],
    "channels": [
        {"name": name, "unit": unit, "role": role, "component": "", "about": "", "t": TIMES, **values}
        for name, unit, role, values in (
            ("gap", "m", "truth", GAP),
            ("speed", "m/s", "truth", SPEED),
            ("calm", "-", "internal", CALM),
            ("brake", "-", "actuator", BRAKE),
        )
    ],
}
ACTOR = {"shape": "box", "length": 4.0, "width": 2.0, "y": 0.0, "heading": 0.0, "visible": True, "about": ""}
SCENE = {
    "follow": "car",
    "speed": "speed",
    "actors": [
        ACTOR | {"name": "car", "x": -2.0, "believed": False},
        ACTOR | {"name": "ahead", "x": ["+", "gap", 2.0], "believed": False},
    ],
    "lines": [
        {"name": n, "points": [], "y": y, "dashed": False} for n, y in (("left", 2.0), ("right", -2.0))
    ],
}
FACTS = {"scene": SCENE, "hazards": [{"name": "H1", "about": "the car hits the one ahead", "terminal": True}]}
SHOW = """([series, facts, options]) => {
    for (const channel of series.channels) {
        channel.t = Float64Array.from(channel.t);
        for (const run of ["golden", "faulty"]) channel[run] = Float32Array.from(channel[run]);
    }
    const place = document.createElement("div");
    document.body.replaceChildren(place);
    window.told = [];
    document.body.addEventListener("replay-time", (event) => window.told.push(event.detail.t));
    window.player = Replay.show(place, series, facts, options);
}"""
T = "Number(document.querySelector('.replay-player').dataset.t)"


class Replayed:
    def __init__(self, page: Any) -> None:
        self.page = page

    def show(self, facts: dict[str, Any], series: dict[str, Any] = SERIES, *, brief: bool = False) -> None:
        self.page.evaluate(SHOW, [series, facts, {"isBrief": brief}])
        self.page.wait_for_function(f"{T} >= 0")

    @property
    def t(self) -> float:
        self.settle()
        return float(self.page.evaluate(T))

    def settle(self) -> None:
        frames = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
        self.page.evaluate(frames)

    def press(self, *keys: str) -> None:
        for key in keys:
            self.page.keyboard.press(key)
        self.settle()

    def text(self, selector: str) -> str:
        self.settle()
        return str(self.page.inner_text(selector))

    def texts(self, selector: str) -> list[str]:
        return list(self.page.eval_on_selector_all(selector, "all => all.map((e) => e.textContent)"))

    def pixels(self, selector: str) -> set[tuple[int, ...]]:
        script = """(canvas) => {
            const { width, height } = canvas, copy = new OffscreenCanvas(width, height), found = new Set();
            const context = copy.getContext("2d", { willReadFrequently: true });
            context.drawImage(canvas, 0, 0);
            const { data } = context.getImageData(0, 0, width, height);
            for (let i = 0; i < data.length; i += 4) {
                if (data[i + 3] === 255) found.add(data.slice(i, i + 3).join());
            }
            return [...found];
        }"""
        return {tuple(map(int, text.split(","))) for text in self.page.eval_on_selector(selector, script)}


@pytest.fixture(scope="module")
def replayed(browser: Any, run: "Path") -> Iterator[Replayed]:
    """The replay on a wide screen, with motion allowed."""
    context = browser.new_context(viewport={"width": 1000, "height": 900}, reduced_motion="no-preference")
    page, errors = context.new_page(), list[str]()
    page.on("console", lambda m: errors.append(m.text) if m.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto((run / "report" / "index.html").as_uri())
    page.wait_for_selector("html[data-ready]")
    made = Replayed(page)
    made.show(FACTS)
    yield made
    context.close()
    assert errors == []


def seek(replayed: Replayed, t: float) -> None:
    replayed.page.evaluate("(t) => { player.clock.pause(); player.clock.seek(t); }", t)
    replayed.page.focus(".timebar")
    replayed.settle()


def test_a_replay_starts_paused_shortly_before_the_activation(browser: Any, replayed: Replayed) -> None:
    replayed.show(FACTS)
    assert replayed.t == BEGIN - 1.0
    assert not replayed.page.evaluate("player.clock.isPlaying")
    assert replayed.page.is_visible("canvas.scene")
    names = "all => all.map((e) => e.getAttribute('aria-label'))"
    gauges = replayed.page.eval_on_selector_all(".gauge", names)
    assert gauges[0] == "Plot of brake"
    plots = replayed.page.eval_on_selector_all(".plot-of", "all => all.map((e) => e.dataset.channel)")
    assert sorted(plots) == ["brake", "gap", "speed"]


def test_keys_move_the_replay(replayed: Replayed) -> None:
    seek(replayed, 1.0)
    replayed.press("ArrowRight")
    assert replayed.t == 1.05
    replayed.press("Shift+ArrowRight", "ArrowLeft")
    assert replayed.t == 2.0
    assert replayed.page.evaluate("told.at(-1)") == 2.0
    assert replayed.text(".state") == "2.00 s\nfault active"
    replayed.press("End")
    assert replayed.t == END
    replayed.press("Home")
    assert replayed.t == 0.0
    assert replayed.text(".state") == "0.00 s\nfault not active yet"


def test_the_time_bar_can_be_dragged_and_has_a_button_for_each_mark(replayed: Replayed) -> None:
    bar = replayed.page.locator(".timebar").bounding_box()
    y = bar["y"] + bar["height"] / 2
    replayed.page.mouse.move(bar["x"] + 5, y)
    replayed.page.mouse.down()
    replayed.page.mouse.move(bar["x"] + bar["width"] / 2, y, steps=3)
    replayed.page.mouse.up()
    assert abs(replayed.t - TIMES[-1] / 2) < 0.02
    assert replayed.page.locator(".timebar .mark").count() == 4
    replayed.page.click(".jump:has-text('brake_hard')")
    assert replayed.t == 3.0
    told = replayed.page.get_attribute(".timebar", "aria-valuetext")
    assert told.startswith("3.00 s, fault active, manifested, brake_hard, brake 0.000 (golden 1.000)")
    assert "gap 17.5" in told


def test_plots_show_the_values_of_the_series(replayed: Replayed) -> None:
    seek(replayed, 3.0)
    at = TIMES.index(3.0)
    head = '.plot-of[data-channel="gap"] .value'
    assert replayed.text(f"{head}.golden") == f"{GAP['golden'][at]:.2f}"
    assert replayed.text(f"{head}.faulty") == f"{GAP['faulty'][at]:.2f}"
    assert replayed.text(f"{head}.by") == "−7.50"
    room = replayed.page.locator('.plot-of[data-channel="gap"] .room').bounding_box()
    replayed.page.mouse.move(room["x"] + room["width"] / 2, room["y"] + 30)
    looked = float(replayed.text(".plots .told").removesuffix(" s"))
    assert 1.0 < looked < 3.0
    index = next(i for i in reversed(range(STEPS)) if TIMES[i] <= looked + 0.005)
    assert replayed.text(f"{head}.golden") in {f"{GAP['golden'][i]:.2f}" for i in (index - 1, index)}
    assert replayed.t == 3.0
    replayed.page.mouse.move(5, 5)


@pytest.mark.parametrize(("high", "note"), [(30000, "axis cut: values range from 2 to 30000"), (150, None)])
def test_a_moment_of_huge_values_does_not_flatten_the_plot(
    replayed: Replayed, high: float, note: str | None
) -> None:
    values = {"golden": [2.0] * STEPS, "faulty": [3.0 if t > BEGIN else 2.0 for t in TIMES]}
    values["faulty"][50] = high
    channel = SERIES["channels"][0] | {"name": "hwt"} | values
    replayed.show(FACTS | {"scene": None}, SERIES | {"channels": [channel]})
    low, top = replayed.page.evaluate("(({ low, high }) => [low, high])(player.axisOf(player.channels[0]))")
    assert (top < 7) == (note is not None)
    assert -10 < low < 2
    assert replayed.texts(".plot-of .note") == ([note] if note else [])
    label = replayed.page.get_attribute(".plot-of canvas", "aria-label")
    assert f"largest difference {high - 2}" in label.replace(".0", "")


def test_a_brief_replay_computes_only_what_it_shows(replayed: Replayed) -> None:
    """Without a scene it builds two plots at most; with one, no plot and no instrument."""
    for scene, count in ((None, 2), (SCENE, 0)):
        replayed.show(FACTS | {"scene": scene}, brief=True)
        assert replayed.page.locator(".plot-of").count() == count
        assert replayed.page.evaluate("player.plots?.plots.size ?? 0") == count
        assert replayed.page.locator(".gauge").count() == 0


def test_marks_close_together_have_separate_buttons(replayed: Replayed) -> None:
    marks = [["alert", 2.5 + i / 1000, f"alert_{i}"] for i in range(6)]
    replayed.show(FACTS, SERIES | {"marks": marks})
    script = "all => all.map((e) => { const { x, y } = e.getBoundingClientRect(); return `${x} ${y}`; })"
    assert len(set(replayed.page.eval_on_selector_all(".jump", script))) == 6
    replayed.show(FACTS)


def test_plots_can_be_selected_and_zoomed(replayed: Replayed) -> None:
    replayed.page.click(".gauge:has-text('calm')")
    assert replayed.page.locator('.plot-of[data-channel="calm"]').count() == 1
    assert replayed.page.get_attribute(".gauge:has-text('calm')", "aria-pressed") == "true"
    replayed.page.click(".gauge:has-text('calm')")
    assert replayed.page.locator('.plot-of[data-channel="calm"]').count() == 0
    seek(replayed, 3.0)
    replayed.press("0")
    assert not replayed.page.is_visible(".timebar .window")
    replayed.press("+", "+")
    assert replayed.page.is_visible(".timebar .window")
    view = replayed.page.evaluate("player.plots.view")
    assert view["to"] - view["from"] == pytest.approx(TIMES[-1] / 1.6**2)
    assert view["from"] < 3.0 < view["to"]


def vivid(colours: set[tuple[int, ...]]) -> bool:
    return any(max(colour) - min(colour) > 60 for colour in colours)


def test_everything_is_gray_after_the_end_of_the_drive(replayed: Replayed) -> None:
    seek(replayed, END)
    assert replayed.text(".state").endswith("H1: the car hits the one ahead")
    assert replayed.page.locator(".is-after").count() == 0
    seek(replayed, END + 0.05)
    assert replayed.text(".state").endswith("after the end of the drive")
    assert replayed.page.locator(".is-after canvas.scene").count() == 1
    room = 'canvas[aria-label^="gap"]'
    replayed.page.evaluate("player.plots.view = { from: 1, to: 3 }; player.plots.width = 0; player.draw()")
    assert vivid(replayed.pixels(room))
    replayed.page.evaluate("player.plots.view = { from: 4.2, to: 6 }; player.plots.width = 0; player.draw()")
    assert not vivid(replayed.pixels(room))


def test_a_ghost_too_far_to_draw_is_named_with_its_distance(replayed: Replayed) -> None:
    ghost = ACTOR | {"name": "believed_lead", "x": 172.0, "believed": True}
    replayed.show(FACTS | {"scene": SCENE | {"actors": [*SCENE["actors"], ghost]}})
    replayed.page.evaluate("""() => {
        window.written = [];
        const paper = document.querySelector("canvas.scene").getContext("2d"), write = paper.fillText;
        paper.fillText = (text, ...place) => (window.written.push(text), write.call(paper, text, ...place));
    }""")
    seek(replayed, 2.5)
    assert "believed lead 170 m ahead ▶" in replayed.page.evaluate("written")
    replayed.show(FACTS)


def test_a_replay_pauses_at_the_end_of_the_drive_and_can_continue(replayed: Replayed) -> None:
    replayed.show(FACTS)
    seek(replayed, 2.2)
    replayed.press(" ")
    replayed.page.wait_for_function("!player.clock.isPlaying")
    rate = float(replayed.page.get_attribute(".replay-player", "data-rate"))
    print(f"replay: {rate:.0f} frames a second")
    assert replayed.t == END
    assert rate > 0
    replayed.page.click("canvas.scene")
    assert replayed.page.evaluate("player.clock.isPlaying")
    replayed.page.wait_for_function(f"{T} > {END}")
    replayed.press(" ")
    assert not replayed.page.evaluate("player.clock.isPlaying")


def test_plots_and_replay_show_the_same_time_during_playback(replayed: Replayed) -> None:
    replayed.show(FACTS)
    seek(replayed, 2.2)
    replayed.page.evaluate("""() => {
        const read = (selector) => document.querySelector(selector).textContent;
        window.clocks = [];
        const draw = player.clock.draw;
        player.clock.draw = (...given) => (draw(...given), window.clocks.push([read(".now"), read(".told")]));
        player.clock.play();
    }""")
    replayed.page.wait_for_function("window.clocks.length > 8")
    replayed.page.evaluate("player.clock.pause()")
    times = replayed.page.evaluate("window.clocks")
    assert len({shown for shown, _ in times}) > 4
    assert [shown for shown, _ in times] == [told for _, told in times]


def test_past_events_stay_listed(replayed: Replayed) -> None:
    """An event's place on the road can be out of sight."""
    replayed.show(FACTS)
    seek(replayed, 2.02)
    assert replayed.texts(".states .chip") == ["fault active"]
    seek(replayed, END)
    hit = "H1: the car hits the one ahead"
    assert replayed.texts(".states .chip") == ["fault active", "manifested", "brake_hard", hit]


def test_a_target_without_a_scene_has_instruments_and_plots(replayed: Replayed) -> None:
    replayed.show(FACTS | {"scene": None})
    assert replayed.page.locator("canvas.scene").count() == 0
    assert replayed.page.locator(".gauge").count() == 4
    replayed.show(FACTS | {"scene": SCENE | {"speed": "v_ego"}})
    assert "The scene cannot be drawn: no channel v_ego." in replayed.text(".replay-player")
    assert replayed.page.locator(".plot-of").count() == 3


def test_with_reduced_motion_a_replay_shows_two_frames_a_second(page: "Page") -> None:
    page.page.evaluate(SHOW, [SERIES, FACTS])
    page.page.click(".replay-player .play")
    page.page.wait_for_function(f"{T} > 2")
    page.page.click(".replay-player .play")
    steps = page.page.evaluate("[...new Set(told)]")
    assert len(steps) <= 5
    assert all(b - a > 0.4 for a, b in pairwise(steps[1:]))


def test_a_closed_replay_draws_nothing(replayed: Replayed) -> None:
    for _ in range(3):
        replayed.show(FACTS)
        replayed.page.click(".replay-player .play")
        replayed.settle()
    replayed.show(FACTS)
    replayed.settle()
    count = """() => new Promise((resolve) => {
        const real = requestAnimationFrame, asked = [];
        window.requestAnimationFrame = (draw) => { asked.push(draw); return real(draw); };
        setTimeout(() => { window.requestAnimationFrame = real; resolve(asked.length); }, 300);
    })"""
    assert replayed.page.evaluate(count) == 0
