"""The figures of a run's results."""

import xml.etree.ElementTree as ET

import pandas as pd
import pytest

from mutator.figures import propagation_time_figure
from mutator.figures.drawings import draw_figures, drawing_files

from ..statistics.results_frame import results

RUN = {"t_activation": 5.0, "t_manifest": 5.5, "t_alert": 6.0}
H1, H2 = {"t_h1": 9.0}, {"t_h2": 8.0}
BLUR = {"module": "vision_input", "fault_type": "blur"}


@pytest.fixture
def frame() -> pd.DataFrame:
    return results(
        RUN | H1,
        RUN | H1 | H2,
        RUN,
        {},
        BLUR | {"scenario": "S2"},
        RUN | H2 | BLUR | {"scenario": "S2", "method": "random"},
    )


def texts(svg: bytes) -> list[str]:
    return ["".join(e.itertext()) for e in ET.fromstring(svg).iter("{http://www.w3.org/2000/svg}text")]


def test_time_panels_include_only_runs_with_both_events(frame: pd.DataFrame) -> None:
    panels = {
        axis.get_title(loc="left"): axis
        for axis in propagation_time_figure.draw_times_by_scenario(frame).axes
    }
    assert [t.get_text() for t in panels["activation to manifest"].texts] == ["3", "1"]
    assert [t.get_text() for t in panels["alert to hazard"].texts] == ["2", "1"]
    means = {line.get_label(): list(line.get_ydata()) for line in panels["alert to hazard"].lines}
    assert means["guided: mean"] == [2.5]
    assert means["random: mean"] == [2.0]


def test_a_figure_drawn_again_has_the_same_bytes(frame: pd.DataFrame) -> None:
    files, again = (drawing_files(draw_figures(frame)) for _ in range(2))
    assert files == again
    assert len(files) == 2
    assert "S2" in texts(files["figures/propagation_by_scenario.svg"])


def test_a_single_scenario_is_not_compared(frame: pd.DataFrame) -> None:
    assert draw_figures(frame.assign(scenario="S1")) == draw_figures(frame[:0]) == ()
    assert [drawing.name for drawing in draw_figures(frame)] == ["propagation_by_scenario"]


def test_runs_without_hazards_or_times_are_drawn(frame: pd.DataFrame) -> None:
    nothing = results({}, BLUR | {"scenario": "S2"})
    assert len(drawing_files(draw_figures(nothing))) == 2
