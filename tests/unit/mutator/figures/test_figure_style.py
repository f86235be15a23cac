"""The style of figures in a page."""

import os
import subprocess
import sys
from pathlib import Path

import matplotlib
import pandas as pd
import pytest

from mutator.figures import propagation_time_figure
from mutator.figures.figure_style import with_page_theme
from mutator.figures.golden_and_faulty_plot import save_figure

_HOSTILE = "axes.facecolor: red\nfont.size: 30\nlines.linewidth: 9\nsvg.fonttype: path\ntext.usetex: True\n"
_DRAW = """
import sys
from pathlib import Path
import pandas as pd
from mutator.figures import propagation_time_figure
from mutator.figures.golden_and_faulty_plot import save_figure
line = {"kind": "a/b", "scenario": "$1", "method": "guided", "is_activated": True, "is_hazard": True}
line |= dict.fromkeys(("t_activation", "t_manifest", "t_alert", "t_hazard"), 1.0)
line |= {"is_manifested": True, "is_alert": False}
save_figure(propagation_time_figure.draw_times_by_scenario(pd.DataFrame([line])), [Path("a.svg")])
"""


def _draw(path: Path) -> bytes:
    line = {"kind": "a/b", "scenario": "S1", "method": "guided", "is_activated": True, "is_hazard": True}
    times = dict.fromkeys(("t_activation", "t_manifest", "t_alert", "t_hazard"), 1.0)
    flags = {"is_manifested": True, "is_alert": False}
    save_figure(propagation_time_figure.draw_times_by_scenario(pd.DataFrame([line | times | flags])), [path])
    return path.read_bytes()


def _drawn_in(folder: Path, rc: Path | None = None) -> bytes:
    """Draw in a process of its own, which starts in `folder`."""
    environment = os.environ | ({"MATPLOTLIBRC": str(rc)} if rc else {})
    told = subprocess.run(
        [sys.executable, "-P", "-c", _DRAW],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (told.returncode, told.stderr) == (0, "")
    return (folder / "a.svg").read_bytes()


def test_the_users_style_changes_no_figure_and_stays_as_it_is(tmp_path: Path) -> None:
    plain = _draw(tmp_path / "a.svg")
    with matplotlib.rc_context({"axes.facecolor": "red", "font.size": 30.0, "svg.fonttype": "path"}):
        assert _draw(tmp_path / "b.svg") == plain
        assert matplotlib.rcParams["font.size"] == 30.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["hostile", "malformed", "not text", "pipe", "user's own"])
def test_no_matplotlibrc_changes_a_figure(tmp_path: Path, kind: str) -> None:
    plain, place = tmp_path / "plain", tmp_path / "place"
    plain.mkdir()
    place.mkdir()
    rc = (tmp_path if kind == "user's own" else place) / "matplotlibrc"
    texts = {"malformed": b"axes.facecolor\nno.such: 1\nfont.size: [\n", "not text": b"\xff\xfe: 1\n"}
    if kind == "pipe":
        os.mkfifo(rc)
    else:
        rc.write_bytes(texts.get(kind, _HOSTILE.encode()))
    assert _drawn_in(place, rc if kind == "user's own" else None) == _drawn_in(plain)


def test_a_figure_in_a_page_follows_the_theme(tmp_path: Path) -> None:
    _draw(tmp_path / "a.svg")
    svg = (tmp_path / "a.svg").read_text()
    shown = with_page_theme(svg)
    assert 'style="fill: #ffffff"' in svg and "#000000" in svg
    assert 'style="fill: #ffffff"' not in shown and "#000000" not in shown
    assert "prefers-color-scheme: dark" in shown
