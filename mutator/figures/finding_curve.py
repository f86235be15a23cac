"""Draws how many distinct findings a search has after each of its runs, as a small SVG.

Its colours are left to `envelopes.css`.
"""

from collections.abc import Sequence

_LEFT, _TOP, _RIGHT, _BOTTOM = 44, 8, 8, 32  # px around the curve
_WIDTH, _HEIGHT = 300, 140  # px of the curve


def draw_finding_curve(counts: Sequence[int], random_counts: Sequence[Sequence[int]] = ()) -> str:
    """Return the SVG of the number of findings after each run; there is at least one run. `random_counts` are
    those of searches that drew their faults at random.
    """
    curves = [counts, *random_counts]
    runs, most = max(map(len, curves)), max(1, *(curve[-1] for curve in curves))
    right, bottom = _LEFT + _WIDTH, _TOP + _HEIGHT
    drawn = (
        f'<path class="border{" before" if number else ""}" d="{_path(curve, runs, most)}"/>'
        for number, curve in enumerate(curves)
    )
    width, height = right + _RIGHT, bottom + _BOTTOM
    label = f"{counts[-1]} findings after {len(counts)} runs"
    if random_counts:
        label += f", drawn at random {', '.join(str(curve[-1]) for curve in random_counts)}"
    return (
        f'<svg class="plane" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        f'width="{width}" height="{height}" role="img" aria-label="{label}">'
        f'<path class="axis" d="M{_LEFT} {_TOP}V{bottom}H{right}"/>{"".join(drawn)}'
        f'<text x="{_LEFT - 5}" y="{_TOP + 4}" text-anchor="end">{most}</text>'
        f'<text x="{_LEFT - 5}" y="{bottom + 3}" text-anchor="end">0</text>'
        f'<text x="{right}" y="{bottom + 13}" text-anchor="end">{runs}</text>'
        f'<text class="unit" x="{right}" y="{bottom + 27}" text-anchor="end">runs</text></svg>'
    )


def _path(counts: Sequence[int], runs: int, most: int) -> str:
    steps = [(0, 0), *((n, count) for n, count in enumerate(counts, 1) if count != ([0, *counts])[n - 1])]
    curve = "".join(f"H{_x(n, runs)}V{_y(count, most)}" for n, count in steps)
    return f"M{_LEFT} {_TOP + _HEIGHT}{curve}H{_x(len(counts), runs)}"


def _x(number: int, runs: int) -> int:
    return _LEFT + round(number / runs * _WIDTH)


def _y(count: int, most: int) -> int:
    return _TOP + _HEIGHT - round(count / most * _HEIGHT)
