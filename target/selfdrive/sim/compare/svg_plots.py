"""Small line plots as inline SVG, in the page's colours."""

from dataclasses import dataclass
from html import escape
from math import floor, log10
from typing import NamedTuple

import numpy as np

# In tenths of a pixel, to use integers.
_WIDTH, _HEIGHT = 3600, 2000
_LEFT, _RIGHT, _TOP, _BOTTOM = 380, 3540, 150, 1750
_SIMPLIFICATION_SLACK = 2.5  # largest distance of a line from its points
_TICK_COUNT = 4  # roughly, because steps are 1, 2 or 5 times a power of ten


class PlotLine(NamedTuple):
    """A line: legend label, colour number in the panel, times (s) and values."""

    label: str
    colour_number: int
    seconds: np.ndarray
    values: np.ndarray
    is_reference: bool = False  # drawn broad and pale below the others


class PlotMark(NamedTuple):
    """An event at a time (s); `kind` is engaged, alert or hazard."""

    kind: str
    label: str
    t: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PlotPanel:
    title: str
    unit: str
    lines: tuple[PlotLine, ...]


def draw_panel(panel: PlotPanel, marks: tuple[PlotMark, ...], end_s: float) -> str:
    low, high, step = _axis_range_and_step(panel.lines)
    parts = [
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img"><title>{escape(panel.title)}</title>',
        *_grid_elements(low, high, step, end_s),
        *(_mark_element(mark, end_s, number) for number, mark in enumerate(marks)),
    ]
    for line in sorted(panel.lines, key=lambda line: not line.is_reference):
        x = _LEFT + line.seconds / end_s * (_RIGHT - _LEFT)
        y = _BOTTOM - (line.values - low) / (high - low) * (_BOTTOM - _TOP)
        kind = f"c{line.colour_number} r" if line.is_reference else f"c{line.colour_number}"
        parts.append(f'<path class="{kind}" d="{_path_data(x, y)}"/>')
    return "".join((*parts, "</svg>"))


def simplify_line(points: np.ndarray, slack: float) -> np.ndarray:
    """The rows of `points` (n, 2; x ascending) for a line within `slack` in y of all points."""
    keep = {0, len(points) - 1}
    spans = [(0, len(points) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        (x0, y0), (x1, y1) = points[first], points[last]
        inner = points[first + 1 : last]
        distances = np.abs(inner[:, 1] - y0 - (inner[:, 0] - x0) * (y1 - y0) / (x1 - x0))
        # A span is split at its farthest point until all points are close (Douglas and Peucker, 1973).
        farthest = int(np.argmax(distances))
        if distances[farthest] > slack:
            middle = first + 1 + farthest
            keep.add(middle)
            spans += [(first, middle), (middle, last)]
    return points[sorted(keep)]


def _path_data(x: np.ndarray, y: np.ndarray) -> str:
    finite = np.isfinite(y)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], finite.astype(int), [0]))))
    parts = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        points = np.column_stack((x[begin:end], y[begin:end]))
        # Relative moves in whole tenths of a pixel take the fewest characters.
        whole = np.round(simplify_line(points, _SIMPLIFICATION_SLACK)).astype(int)
        parts.append(
            f"M{whole[0][0]} {whole[0][1]}l" + " ".join(f"{a} {b}" for a, b in np.diff(whole, axis=0))
        )
    return "".join(part.rstrip("l") for part in parts).replace(" -", "-")


def _axis_range_and_step(lines: tuple[PlotLine, ...]) -> tuple[float, float, float]:
    finite = np.concatenate([line.values[np.isfinite(line.values)] for line in lines] or [np.zeros(1)])
    if not finite.size:
        finite = np.zeros(1)
    low, high = min(0.0, float(finite.min())), max(0.1, float(finite.max()))
    rough = (high - low) / _TICK_COUNT
    size = 10.0 ** floor(log10(rough))
    step = next(factor * size for factor in (1.0, 2.0, 5.0, 10.0) if factor * size >= rough * 0.999)
    return floor(low / step + 1e-9) * step, -floor(-high / step + 1e-9) * step, step


def _grid_elements(low: float, high: float, step: float, end_s: float) -> list[str]:
    parts = []
    for number in range(round((high - low) / step) + 1):
        y = round(_BOTTOM - number * step / (high - low) * (_BOTTOM - _TOP))
        kind = "z" if abs(low + number * step) < step / 2 else "g"
        parts.append(f'<path class="{kind}" d="M{_LEFT} {y}H{_RIGHT}"/>')
        parts.append(f'<text x="{_LEFT - 40}" y="{y + 35}" class="e">{low + number * step:.6g}</text>')
    seconds = next(size for size in (1, 2, 5, 10, 20, 50, 100, 1000) if end_s / size <= 8)
    for t in range(0, int(end_s) + 1, seconds):
        x = round(_LEFT + t / end_s * (_RIGHT - _LEFT))
        parts.append(f'<text x="{x}" y="{_BOTTOM + 140}" class="m">{t}</text>')
    return parts


def _mark_element(mark: PlotMark, end_s: float, number: int) -> str:
    x = round(_LEFT + mark.t / end_s * (_RIGHT - _LEFT))
    anchor = "e" if x > (_LEFT + _RIGHT) / 2 else "b"
    at = x - 25 if anchor == "e" else x + 25
    label = f'<text x="{at}" y="{_TOP + 10 + 105 * (number % 4)}" class="{anchor} {mark.kind}">'
    return f'<path class="{mark.kind}" d="M{x} {_TOP}V{_BOTTOM}"/>{label}{escape(mark.label)}</text>'
