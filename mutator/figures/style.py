"""The common style of figures.

The colours are those of Okabe and Ito, which colour-blind people can distinguish.
"""

import importlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import RLock
from typing import TYPE_CHECKING, Any

from mutator.errors import MutatorError
from mutator.model import Method

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 11.0  # inches
TEXT, SMALL = 9, 8  # points
INK = "#222222"
HAZARD_COLOURS = ("#d55e00", "#f0e442", "#56b4e9", "#009e73", "#cc79a7", "#e69f00")
SEVERAL_COLOUR = "#444444"
_NAME, _RC_FILE = "matplotlib", "matplotlibrc"
_STYLE = {  # what differs from matplotlib's defaults
    "svg.hashsalt": "mutator",  # a fixed salt keeps the SVG deterministic
    "svg.fonttype": "none",
    "text.parse_math": False,  # a `$` in a name is a `$`
}
_drawing = RLock()  # matplotlib's style is global
_METHOD_LOOKS = (("#0072b2", "o"), ("#d55e00", "s"), ("#009e73", "^"), ("#cc79a7", "D"))


@contextmanager
def shipped_style() -> Iterator[None]:
    """Draw in the shipped style alone, whatever a matplotlibrc says; also a decorator.

    MutatorError if the user's own matplotlibrc keeps matplotlib from loading.
    """
    with _drawing:
        matplotlib = _matplotlib()
        with matplotlib.rc_context():
            matplotlib.rcdefaults()
            matplotlib.rcParams.update(_STYLE)
            yield


def _matplotlib() -> Any:
    """Import matplotlib without ./matplotlibrc: the current folder can be somebody's library."""
    if _NAME not in sys.modules:
        exists = os.path.exists
        os.path.exists = lambda path: path != _RC_FILE and exists(path)
        try:
            importlib.import_module(_NAME)
        except (ValueError, OSError) as err:
            raise MutatorError(
                f"matplotlib cannot read its settings ({err})",
                expected=f"a valid {_RC_FILE}, or none",
                remedy=f"correct or delete the {_RC_FILE} of MATPLOTLIBRC or of your configuration folder",
            ) from None
        finally:
            os.path.exists = exists
    return sys.modules[_NAME]


def method_look(method: str) -> tuple[str, str]:
    return _METHOD_LOOKS[list(Method).index(Method(method)) % len(_METHOD_LOOKS)]


def blank(height: float, rows: int, columns: int, *, sharey: bool = False) -> tuple["Figure", list["Axes"]]:
    """Return an empty figure of `height` inches, with its axes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(rows, columns, squeeze=False, sharey=sharey).flat)
    for axis in axes:
        axis.tick_params(labelsize=TEXT, length=0)
        axis.spines[["top", "right"]].set_visible(False)
    return figure, axes


_DARK = """<style>
svg { color: #1b2027; --several: #444444; --hazard: #b00020 } text { fill: currentColor }
@media screen and (prefers-color-scheme: dark) {
  svg { color: #e4e8ec; --several: #a5afba; --hazard: #ff9a90 }
}
</style>"""
_THEMED = {  # black parts follow the theme; the background is transparent
    'style="fill: #ffffff"': 'style="fill: none"',
    "#000000": "currentColor",
    INK: "currentColor",
    "#555555": "currentColor",
    SEVERAL_COLOUR: "var(--several)",
    "#b00020": "var(--hazard)",
}


def themed(svg: str) -> str:
    """Return a figure's SVG with a transparent background, and with light ink on a dark page."""
    for colour, shown in _THEMED.items():
        svg = svg.replace(colour, shown)
    return svg.replace("<defs>", f"{_DARK}<defs>", 1)
