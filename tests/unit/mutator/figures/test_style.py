"""The style of figures in a page."""

import pandas as pd

from mutator.figures import heat_map
from mutator.figures.run_plot import save
from mutator.figures.style import themed


def test_a_figure_in_a_page_follows_the_theme(tmp_path) -> None:
    line = {"kind": "a/b", "scenario": "S1", "method": "guided", "is_activated": True, "is_hazard": True}
    times = dict.fromkeys(("t_activation", "t_manifest", "t_hazard"), 1.0)
    flags = {"is_manifested": True, "is_alert": False}
    save(heat_map.draw(pd.DataFrame([line | times | flags])), [tmp_path / "a.svg"])
    svg = (tmp_path / "a.svg").read_text()
    shown = themed(svg)
    assert 'style="fill: #ffffff"' in svg and "#000000" in svg
    assert 'style="fill: #ffffff"' not in shown and "#000000" not in shown
    assert "prefers-color-scheme: dark" in shown
    assert "fill: #010101" in shown
