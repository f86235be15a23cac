"""The figure of an envelope."""

from dataclasses import replace

import pytest

from mutator.explore.envelope import Envelope
from mutator.figures.envelope_figure import draw_envelope
from tests.unit.mutator.explore.made_envelopes import MADE_PLANE, envelope_of, line, never

NO_VALUE = replace(MADE_PLANE, magnitudes=[])


@pytest.mark.parametrize(
    ("envelope", "labels"),
    [
        (envelope_of(line), {"without hazard", "hazardous", "run with hazard", "run without hazard"}),
        (envelope_of(never), {"without hazard", "run without hazard"}),
        (envelope_of(lambda m, d: 2.0 if d > 1 else None, NO_VALUE), {"hazardous", "run with hazard"}),
    ],
)
def test_the_legend_has_what_is_drawn(envelope: Envelope, labels: set[str]) -> None:
    """Each kind of cell and run of the plane, on logarithmic axes, with the unit."""
    figure = draw_envelope(envelope)
    [axis] = figure.axes
    assert labels <= {text.get_text() for text in figure.legends[0].get_texts()}
    assert axis.get_xscale() == "log" and axis.get_xlabel() == "duration [s]"
    assert (axis.get_ylabel() == "magnitude [m]") == bool(envelope.plane.magnitudes)
    assert figure._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]
