"""The picture of a plane: small, well-formed, and with a text alternative."""

import re
from dataclasses import replace
from itertools import pairwise
from xml.etree import ElementTree

import pytest

from mutator.explore.cell_results import CellState
from mutator.explore.envelope import Envelope
from mutator.explore.lattice import durations_between, magnitudes_between
from mutator.figures.plane_drawing import draw_plane, draw_two_planes
from mutator.report.explored_planes import ExploredPlanes
from mutator.report.panels.envelopes_panel import panel_of_planes
from tests.unit.mutator.explore.made_envelopes import MADE_PLANE, envelope_of, line, never
from tests.unit.mutator.explore.made_planes import STEP_S, Truth

FINE = replace(
    MADE_PLANE,
    magnitudes=list(magnitudes_between(0.6, 60.0, 51)),
    durations_s=list(durations_between(STEP_S, 15.0, 51, STEP_S)),
)


def island(magnitude: float, duration_s: float) -> float | None:
    return 30.0 if 1.0 < duration_s < 2.0 else line(magnitude, duration_s) if magnitude > 20 else None


@pytest.mark.parametrize(
    "envelope",
    [
        envelope_of(line),
        envelope_of(never),
        envelope_of(island),
        envelope_of(never, most_runs=1),
        envelope_of(line, replace(MADE_PLANE, magnitudes=[])),
        envelope_of(line, replace(MADE_PLANE, magnitudes=[-5.0], durations_s=[0.5])),
    ],
)
def test_each_plane_has_a_picture(envelope: Envelope) -> None:
    """Well-formed, with its description, all numbers finite, and every run as a dot."""
    svg = draw_plane(envelope, "a < b")
    root = ElementTree.fromstring(svg)
    assert (root.get("role"), root.get("aria-label")) == ("img", "a < b")
    assert "nan" not in svg and "inf" not in svg.replace("inferred", "")
    dots = [path.get("d", "") for path in root.iter() if "dots" in (path.get("class") or "")]
    assert sum(path.count("M") for path in dots) == envelope.run_count


def test_islands_are_outlined() -> None:
    """Hazardous cells apart from the largest group have an edge; a plane without them has none."""
    small = envelope_of(lambda m, d: 9.0 if (m < 1 and 1 < d < 3) or (m > 20 and d > 0.1) else None)
    assert len(small.islands()) == 1
    assert 'class="island"' in draw_plane(small, "") and 'class="island"' not in draw_plane(
        envelope_of(line), ""
    )


def test_runs_that_ended_disengaged_are_crosses() -> None:
    """Which no other kind of run has."""
    drawn = draw_plane(
        envelope_of(never, crashes=lambda m, d: m > 20, without_result=CellState.DISENGAGED), ""
    )
    assert 'class="crosses"' in drawn and 'class="crosses"' not in draw_plane(envelope_of(never), "")


def test_ticks_are_apart() -> None:
    """Numbers of an axis never overlap."""
    svg = draw_plane(envelope_of(line, FINE), "")
    places = sorted(int(x) for x in re.findall(r'x="(\d+)" y="\d+" text-anchor="middle"', svg))
    assert len(places) >= 3 and min(b - a for a, b in pairwise(places)) >= 20


def test_pictures_are_small() -> None:
    """At 51 x 51 cells, rows and pictures of 400 planes take less than half of a page of 5 MB: of 40, a
    tenth. The worst twelve are open.
    """
    envelopes = [envelope_of(line, FINE), envelope_of(island, FINE)] * 20
    panel = panel_of_planes(ExploredPlanes.of_envelopes(envelopes, {}))
    assert panel.html.count("<svg") == 40 and re.search("<summary>28.more planes</summary>", panel.html)
    assert len(panel.html.encode()) < 250_000


@pytest.mark.parametrize(("before", "after"), [(never, line), (line, never), (line, line), (never, never)])
def test_two_planes_are_drawn_over_each_other(before: Truth, after: Truth) -> None:
    """The border of each that has hazards, and the cells that changed."""
    svg = draw_two_planes(envelope_of(before), envelope_of(after), "a < b")
    classes = [path.get("class") for path in ElementTree.fromstring(svg).iter()]
    assert ("border before" in classes, "border after" in classes) == (before is line, after is line)
    assert ("worse" in classes) is (after is line and before is never)
    assert ("better" in classes) is (before is line and after is never)


def test_what_a_run_no_longer_decides_is_drawn() -> None:
    """Cells that the first run calls without hazard, and the second does not say."""
    svg = draw_two_planes(envelope_of(never), envelope_of(never, most_runs=1), "")
    assert 'class="lost"' in svg and 'class="border' not in svg
