"""The page of maneuvers is complete, self-contained and small, and it matches the data."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from selfdrive.sim.compare.svg_plots import PlotLine, PlotMark, PlotPanel, draw_panel, simplify_line
from selfdrive.sim.maneuvers import main
from selfdrive.sim.replay import main as replay

BRIEF = """schema: scenario/1
name: {name}
title: into a <standing> lead
duration_s: 2
host: {{speed_mps: 20}}
lead: {{gap_m: 20, speed_mps: 0}}
"""


@pytest.fixture
def folder(tmp_path):
    for name in ("A", "B"):
        (tmp_path / f"{name}.yaml").write_text(BRIEF.format(name=name))
    arguments = ["--references", str(tmp_path / "kept"), "--scenarios", str(tmp_path), "--update-references"]
    assert replay(["A", *arguments]) == 0
    return tmp_path


def show(folder, *arguments):
    code = main(["--out", str(folder / "page"), "--scenarios", str(folder), *arguments])
    return code, (folder / "page" / "index.html").read_text() if code == 0 else ""


def test_the_page_has_all_scenarios_and_loads_nothing(folder):
    code, text = show(folder, "--references", str(folder / "kept"), "--plant", "reference")
    assert code == 0
    first, second = re.findall(r"<section.*?</section>", text)
    assert 'class="c0 r"' in first
    assert 'class="c0 r"' not in second
    assert first.count("<svg") == 5
    assert '<path class="hazard"' in first
    assert "H1 at 1.0" in first
    assert "&lt;standing&gt;" in first
    assert text.count("within tolerance") == 1
    assert not re.search(r"https?://|<script|<link|src=|@import|url\(", text)
    for svg in re.findall(r"<svg.*?</svg>", text):
        ET.fromstring(svg)
    assert len(text) < 60_000


def test_the_page_is_the_same_each_time(folder):
    assert show(folder, "A") == show(folder, "A")


def test_scenarios_that_the_plant_does_not_support_are_left_out(folder, capsys):
    bend = BRIEF.format(name="B") + "road: {curvature: {at_m: [0], per_m: [0.001]}}\n"
    (folder / "B.yaml").write_text(bend)
    code, text = show(folder, "--plant", "reference")
    assert code == 0
    assert text.count("<section") == 1
    assert "left out: B" in capsys.readouterr().out
    assert show(folder, "--plant", "reference", "B")[0] == 2


def test_user_errors_exit_with_code_2(folder, tmp_path, capsys):
    assert main(["--out", str(tmp_path / "page"), "--scenarios", str(folder), "X"]) == 2
    assert main(["--out", str(tmp_path / "page"), "--scenarios", str(tmp_path / "nowhere")]) == 2
    assert main(["--out", str(folder / "A.yaml"), "--scenarios", str(folder), "A"]) == 2
    (folder / "B.yaml").write_text("schema: scenario/9\n")
    assert main(["--out", str(tmp_path / "page"), "--scenarios", str(folder)]) == 2
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == 4
    assert all(error.startswith("error: ") for error in errors)


def test_a_simplified_line_stays_within_the_tolerance():
    x = np.linspace(0.0, 1000.0, 600)
    y = 300.0 * np.sin(x / 60.0) + 200.0 * (x > 500.0)
    few = simplify_line(np.column_stack((x, y)), 2.5)
    assert len(few) < 150
    assert np.abs(np.interp(x, few[:, 0], few[:, 1]) - y).max() <= 2.5
    assert (few[0, 0], few[-1, 0]) == (0.0, 1000.0)


def test_gaps_and_constants_are_drawn():
    t = np.arange(10) / 20
    broken = np.where(np.arange(10) == 5, np.inf, 1.0)
    panel = PlotPanel(
        title="a", unit="m", lines=(PlotLine("b", 0, t, broken), PlotLine("c", 1, t, np.full(10, np.nan)))
    )
    svg = draw_panel(panel, (PlotMark("alert", "fcw", 0.25),), 0.5)
    paths = dict(re.findall(r'<path class="(c\d)" d="([^"]*)"/>', svg))
    assert paths["c0"].count("M") == 2
    assert paths["c1"] == ""
    assert ">fcw</text>" in svg
