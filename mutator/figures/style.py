"""How the figures of a report look alike: colours, sizes, the empty page they are drawn on.

A page shows them in its light or dark theme (`themed`). Colours are those of Okabe and Ito, told apart by
colour-blind readers; methods differ in their markers, too.
"""

from typing import TYPE_CHECKING

from mutator.model import Method

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 11.0  # inches
TEXT, SMALL = 9, 8  # points
INK = "#222222"
HAZARD_COLOURS = ("#d55e00", "#f0e442", "#56b4e9", "#009e73", "#cc79a7", "#e69f00")
SEVERAL_COLOUR = "#444444"
_METHOD_LOOKS = (("#0072b2", "o"), ("#d55e00", "s"), ("#009e73", "^"), ("#cc79a7", "D"))


def method_look(method: str) -> tuple[str, str]:
    """Colour and marker: a method looks the same in every report, also where it is alone."""
    return _METHOD_LOOKS[list(Method).index(Method(method)) % len(_METHOD_LOOKS)]


def blank(height: float, rows: int, columns: int, *, sharey: bool = False) -> tuple["Figure", list["Axes"]]:
    """A figure of `height` inches with its axes, row after row."""
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
_THEMED = {  # what is drawn in black or nearly so follows the theme; a white ground lets the page show
    'style="fill: #ffffff"': 'style="fill: none"',
    "#000000": "currentColor",
    INK: "currentColor",
    "#555555": "currentColor",
    SEVERAL_COLOUR: "var(--several)",
    "#b00020": "var(--hazard)",
}


def themed(svg: str) -> str:
    """A figure's SVG as a page shows it: without a ground, its ink light where the page is dark."""
    for colour, shown in _THEMED.items():
        svg = svg.replace(colour, shown)
    return svg.replace("<defs>", f"{_DARK}<defs>", 1)
