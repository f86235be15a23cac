"""The common style of figures.

The colours are those of Okabe and Ito, which colour-blind people can distinguish.
"""

import importlib
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from threading import RLock
from typing import TYPE_CHECKING, Any

from mutator.errors import MutatorError
from mutator.model import Method

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FIGURE_WIDTH_INCHES = 11.0  # inches
PNG_DPI = 110
TEXT_POINTS, SMALL_TEXT_POINTS = 9, 8  # points
INK_COLOUR = "#222222"
_MATPLOTLIB, _RC_FILE = "matplotlib", "matplotlibrc"
_MATPLOTLIB_SETTINGS = {  # what differs from matplotlib's defaults
    "svg.hashsalt": "mutator",  # a fixed salt keeps the SVG deterministic
    "svg.fonttype": "none",
    "text.parse_math": False,  # a `$` in a name is a `$`
}
_style_lock = RLock()  # matplotlib's style is global
_METHOD_COLOURS_AND_MARKERS = (("#0072b2", "o"), ("#d55e00", "s"), ("#009e73", "^"), ("#cc79a7", "D"))


@contextmanager
def shipped_style() -> Iterator[None]:
    """Draw in the shipped style alone, whatever a matplotlibrc says; also a decorator.

    MutatorError if the user's own matplotlibrc keeps matplotlib from loading.
    """
    with _style_lock:
        matplotlib = _matplotlib()
        with matplotlib.rc_context():
            matplotlib.rcdefaults()
            matplotlib.rcParams.update(_MATPLOTLIB_SETTINGS)
            yield


def _matplotlib() -> Any:
    """Import matplotlib without ./matplotlibrc: the current folder can be somebody's library."""
    if _MATPLOTLIB not in sys.modules:
        exists = os.path.exists
        os.path.exists = lambda path: path != _RC_FILE and exists(path)
        try:
            importlib.import_module(_MATPLOTLIB)
        except (ValueError, OSError) as err:
            raise MutatorError(
                f"matplotlib cannot read its settings ({err})",
                expected=f"a valid {_RC_FILE}, or none",
                remedy=f"correct or delete the {_RC_FILE} of MATPLOTLIBRC or of your configuration folder",
            ) from None
        finally:
            os.path.exists = exists
    return sys.modules[_MATPLOTLIB]


def colour_and_marker(method: str) -> tuple[str, str]:
    return _METHOD_COLOURS_AND_MARKERS[list(Method).index(Method(method)) % len(_METHOD_COLOURS_AND_MARKERS)]


@cache
def figure_type() -> type["Figure"]:
    """Return the type of all figures, which notebooks show without pyplot."""
    from matplotlib.figure import Figure

    class RunFigure(Figure):
        @shipped_style()
        def _repr_png_(self) -> bytes:
            self.savefig(png := io.BytesIO(), format="png", dpi=PNG_DPI)
            return png.getvalue()

    return RunFigure


def blank_figure(
    height: float, rows: int, columns: int, *, sharey: bool = False
) -> tuple["Figure", list["Axes"]]:
    """Return an empty figure of `height` inches, with its axes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = figure_type()(figsize=(FIGURE_WIDTH_INCHES, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(rows, columns, squeeze=False, sharey=sharey).flat)
    for axis in axes:
        axis.tick_params(labelsize=TEXT_POINTS, length=0)
        axis.spines[["top", "right"]].set_visible(False)
    return figure, axes


_THEME_CSS = """<style>
svg { color: #1b2027; --hazard: #b00020 } text { fill: currentColor }
@media screen and (prefers-color-scheme: dark) {
  svg { color: #e4e8ec; --hazard: #ff9a90 }
}
</style>"""
_THEMED_COLOURS = {  # black parts follow the theme; the background is transparent
    'style="fill: #ffffff"': 'style="fill: none"',
    "#000000": "currentColor",
    INK_COLOUR: "currentColor",
    "#555555": "currentColor",
    "#b00020": "var(--hazard)",
}


def with_page_theme(svg: str) -> str:
    """Return a figure's SVG with a transparent background, and with light ink on a dark page."""
    for colour, replacement in _THEMED_COLOURS.items():
        svg = svg.replace(colour, replacement)
    return svg.replace("<defs>", f"{_THEME_CSS}<defs>", 1)
