"""Plots of a golden run and a faulty run."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mutator.errors import MutatorError
from mutator.figures.golden_and_faulty_plot import (
    AFTER_END_COLOUR,
    MARK_COLOURS,
    EventKind,
    EventMark,
    draw_golden_and_faulty,
    event_marks,
    save_figure,
)
from mutator.model import ObservedActivation, Outcome, Record, Status
from mutator.targets.channels import Channel

TIME = np.arange(300) * 0.01


@pytest.fixture
def manifest() -> SimpleNamespace:
    gas, speed = Channel(name="gas", unit="0..1"), Channel(name="v_ego", unit="m/s")
    gone = Channel(name="not_recorded", unit="m")
    channels = {"compared_channels": (gas,), "non_actuator_channels": (speed, gone)}
    return SimpleNamespace(**channels, time_channel="t", path=Path("m.yaml"))


def trace(offset: float = 0.0) -> dict[str, np.ndarray]:
    speed = np.full_like(TIME, 26.8)
    speed[-10:] = np.inf
    return {"t": TIME, "gas": np.sin(TIME) + offset, "v_ego": speed}


def test_an_svg_contains_channels_units_and_marks(tmp_path: Path, manifest: SimpleNamespace) -> None:
    mark = EventMark(kind=EventKind.HAZARD, t_s=1.5, label="H1")
    figure = draw_golden_and_faulty(trace(), trace(0.1), manifest, title="chaff 35 m", marks=[mark])
    save_figure(figure, [tmp_path / "p.svg"])
    root = ET.parse(tmp_path / "p.svg").getroot()
    text = " ".join("".join(e.itertext()) for e in root.iter("{http://www.w3.org/2000/svg}text"))
    for wanted in (
        "chaff 35 m",
        "gas",
        "[0..1]",
        "v_ego",
        "[m/s]",
        "H1 1.50",
        "golden",
        "faulty",
        "time [s]",
    ):
        assert wanted in text
    assert "not_recorded" not in text


def test_everything_after_the_end_of_the_drive_is_grey(manifest: SimpleNamespace) -> None:
    faulty = trace()
    faulty["gas"] = np.where(TIME > 2.0, -500.0, faulty["gas"])
    marks = [EventMark(kind=EventKind.HAZARD, t_s=t, label="H") for t in (2.0, 2.5)]
    gas, _ = draw_golden_and_faulty(trace(), faulty, manifest, title="x", marks=marks, end=2.0).axes
    golden_line, faulty_line, *later = gas.lines[:4]
    assert -1.0 < gas.get_ylim()[0] < 0.0 < 1.0 < gas.get_ylim()[1] < 2.0
    for line in (golden_line, faulty_line):
        assert np.nanmax(np.where(np.isnan(line.get_ydata()), np.nan, line.get_xdata())) == 2.0
    assert {line.get_color() for line in later} == {AFTER_END_COLOUR}
    assert np.nanmin(later[1].get_ydata()) == -500.0
    assert [line.get_color() for line in gas.lines[4:]] == [MARK_COLOURS[EventKind.HAZARD], AFTER_END_COLOUR]
    whole, _ = draw_golden_and_faulty(trace(), faulty, manifest, title="x").axes
    assert (len(whole.lines), whole.get_ylim()[0] < -500.0) == (2, True)


def test_a_plot_drawn_again_has_the_same_bytes(tmp_path: Path, manifest: SimpleNamespace) -> None:
    for name in ("a.svg", "b.svg"):
        save_figure(draw_golden_and_faulty(trace(), trace(0.1), manifest, title="x"), [tmp_path / name])
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_a_file_with_the_suffix_png_is_a_png_image(tmp_path: Path, manifest: SimpleNamespace) -> None:
    save_figure(draw_golden_and_faulty(trace(), trace(), manifest, title="x"), [tmp_path / "p.png"])
    assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")


def test_runs_without_a_common_channel_are_refused(tmp_path: Path, manifest: SimpleNamespace) -> None:
    with pytest.raises(MutatorError, match=re.escape("m.yaml")):
        draw_golden_and_faulty(trace(), {"t": TIME}, manifest, title="x")


def test_marks_of_a_record_are_sorted_by_time() -> None:
    record = Record(
        experiment_id="0" * 16,
        status=Status.OK,
        outcome=Outcome.HAZARD,
        detail="",
        tree="",
        activation=ObservedActivation(first=6.94, last=20.0, count=12),
        t_manifest=7.0,
        max_dev=(),
        hazards=(("H1", 18.0),),
        alerts=(("fcw", 16.0),),
        trace_digest="",
    )
    kinds = [(m.kind, m.t_s) for m in event_marks(record)]
    assert kinds == [
        (EventKind.TRIGGER, 6.94),
        (EventKind.MANIFEST, 7.0),
        (EventKind.ALERT, 16.0),
        (EventKind.HAZARD, 18.0),
    ]
