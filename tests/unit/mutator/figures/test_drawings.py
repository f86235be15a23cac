"""The figures of a run's results."""

import xml.etree.ElementTree as ET

import pandas as pd
import pytest

from mutator.figures import hazard_heat_map, hazards_by_fault_type, propagation_times
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


def test_each_run_with_a_hazard_is_in_exactly_one_part_of_a_bar(frame: pd.DataFrame) -> None:
    assert list(hazards_by_fault_type.hazard_labels(frame)) == ["H1", "several", "", "", "", "H2"]


def test_hazard_bars_show_counts(frame: pd.DataFrame) -> None:
    figure = hazards_by_fault_type.draw(frame)
    guided, _, rates = figure.axes
    widths = {c.get_label(): [bar.get_width() for bar in c] for c in guided.containers}
    assert widths == {"H1 alone": [1, 0], "H2 alone": [0, 0], "H3 alone": [0, 0], "more than one": [1, 0]}
    assert [text.get_text() for text in guided.texts] == ["2 of 4", "0 of 1"]
    drawn = {c.get_label(): list(c.lines[0].get_xdata()) for c in rates.containers}
    assert drawn == {"guided": [pytest.approx(200 / 3)], "random": [100]}


def test_the_heat_map_shows_hazards_per_activated_fault(frame: pd.DataFrame) -> None:
    guided = hazard_heat_map.draw(frame).axes[0]
    assert sorted(text.get_text() for text in guided.texts) == ["0/0", "2/3"]
    cells = guided.images[0].get_array()
    assert cells[0, 0] == pytest.approx(200 / 3)
    assert cells.mask.tolist() == [[False, True], [True, True]]


def test_time_panels_include_only_runs_with_both_events(frame: pd.DataFrame) -> None:
    panels = {axis.get_title(loc="left"): axis for axis in propagation_times.draw(frame).axes}
    assert [t.get_text() for t in panels["activation to manifest"].texts] == ["3", "1"]
    assert [t.get_text() for t in panels["alert to hazard"].texts] == ["2", "1"]
    means = {line.get_label(): list(line.get_ydata()) for line in panels["alert to hazard"].lines}
    assert means["guided: mean"] == [2.5]
    assert means["random: mean"] == [2.0]


def test_a_figure_drawn_again_has_the_same_bytes(frame: pd.DataFrame) -> None:
    files, again = (drawing_files(draw_figures(frame)[:1]) for _ in range(2))
    assert files == again
    assert len(files) == 2
    assert "vision_input/blur" in texts(files["figures/hazards_by_fault_type.svg"])


def test_a_single_fault_type_or_scenario_is_not_compared(frame: pd.DataFrame) -> None:
    chaff, blur = frame[frame["kind"] == "radar/chaff"], frame[frame["scenario"] == "S2"]
    assert draw_figures(chaff) == draw_figures(blur) == draw_figures(frame[:0]) == ()
    one_scenario = frame.assign(scenario="S1")
    assert [drawing.name for drawing in draw_figures(one_scenario)] == ["hazards_by_fault_type"]
    assert [d.name for d in draw_figures(frame.assign(kind="a/b"))] == ["propagation_by_scenario"]


def test_runs_without_hazards_or_times_are_drawn(frame: pd.DataFrame) -> None:
    nothing = results({}, BLUR | {"scenario": "S2"})
    assert len(drawing_files(draw_figures(nothing))) == 6
