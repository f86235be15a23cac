"""Where a plane can still hide an island of hazardous cells.

Distances are in cells, the greater one of those in magnitude and in duration.
"""

from collections.abc import Iterator, Sequence
from math import inf

import numpy as np

from mutator.explore.cell_results import CellState
from mutator.explore.lattice import Cell
from mutator.explore.plane_map import Line, PlaneMap

_MOST_PLACES = 48  # at once: enough for the batches that are in flight
_LEAST_DISTANCE = 2  # from the nearest driven cell: nearer by, no island of 3 x 3 fits in
_WIDEST_SLOPE = 12  # as far from a hazard, a margin is not small because of it
_LEAST_MARGIN = 0.01  # of the largest one: no margin counts as smaller
_LEAST_WEIGHT = 0.5  # so that large gaps are looked into, whatever the margins say


def places_to_look(plane: PlaneMap, cells: Sequence[Line], decidable: int) -> list[Cell]:
    """Return undriven cells that `cells` calls without hazard and that are far from all others, and from
    those before it; empty once every square of 3 x 3 such cells was looked into.

    Those come first that are nearest to a run with a small margin, but not to a hazard, which would explain
    it. Only the first `decidable` durations count.
    """
    is_between = np.array([[state is CellState.BETWEEN_WITHOUT for state in line] for line in cells])
    is_between = is_between[:, :decidable]
    is_hazardous = np.array([[state.is_hazardous for state in line] for line in cells])[:, :decidable]
    # beyond the edge is no room for an island
    distances = _nearest(np.pad(~is_between, 1, constant_values=True))[0][1:-1, 1:-1]
    weights = _weights(plane, is_between, is_hazardous)
    places: list[Cell] = []
    while len(places) < _MOST_PLACES and distances.max() >= _LEAST_DISTANCE:
        scores = np.where(distances >= _LEAST_DISTANCE, distances * weights, 0.0)
        line, duration = divmod(int(scores.argmax()), distances.shape[1])
        places.append((line, duration))
        np.minimum(distances, _distances_from(line, duration, distances.shape), out=distances)
    return places


def _weights(plane: PlaneMap, is_between: np.ndarray, is_hazardous: np.ndarray) -> np.ndarray:
    """Return how much each cell deserves a look: the more, the smaller the margins of the nearest runs are,
    and the farther away a hazard is. Without margins, all deserve the same.
    """
    weights = np.full(is_between.shape, _LEAST_WEIGHT)
    far = 1.0
    if is_hazardous.any():
        far = np.minimum(_nearest(is_hazardous)[0], _WIDEST_SLOPE) / _WIDEST_SLOPE
    for margins in _margins(plane, is_between.shape):
        share = np.maximum(margins / margins[np.isfinite(margins)].max(), _LEAST_MARGIN)
        _, nearest = _nearest(~is_between, share)
        weights = np.maximum(weights, np.where(is_between, far / (nearest * nearest), 0.0))
    return weights


def _margins(plane: PlaneMap, shape: tuple[int, ...]) -> Iterator[np.ndarray]:
    """Yield for each kind of margin those of the runs without hazard; infinite for other cells."""
    results = {
        (i, j): result.margins
        for (i, j), result in plane.results.items()
        if j < shape[1] and result.state is CellState.WITHOUT_HAZARD
    }
    for name in sorted({name for margins in results.values() for name in margins}):
        values = np.full(shape, inf)
        for cell, margins in results.items():
            values[cell] = margins.get(name, inf)
        if np.isfinite(values).any() and values[np.isfinite(values)].max() > 0:
            yield values


def _nearest(mask: np.ndarray, values: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return for each cell its distance to the nearest cells of `mask`, and the least of their `values`."""
    covered = np.pad(mask, 1)
    least = np.full(covered.shape, inf)
    if values is not None:
        least[1:-1, 1:-1] = np.where(mask, values, inf)
    distances = np.zeros(covered.shape, dtype=int)
    while not covered[1:-1, 1:-1].all():
        distances += ~covered
        grown, low = covered, least
        for axis in (0, 1):
            grown = grown | _beside(grown, axis, 1, False) | _beside(grown, axis, -1, False)
            low = np.minimum(np.minimum(low, _beside(low, axis, 1, inf)), _beside(low, axis, -1, inf))
        covered, least = grown, np.where(covered, least, low)
    return distances[1:-1, 1:-1], least[1:-1, 1:-1]


def _beside(array: np.ndarray, axis: int, step: int, beyond: float) -> np.ndarray:
    """Return the values of the neighbours on one side; `beyond` the edge for those without."""
    moved = np.roll(array, step, axis)
    moved[(slice(None),) * axis + (0 if step == 1 else -1,)] = beyond
    return moved


def _distances_from(line: int, duration: int, shape: tuple[int, ...]) -> np.ndarray:
    lines, durations = np.arange(shape[0]), np.arange(shape[1])
    return np.maximum(np.abs(lines - line)[:, None], np.abs(durations - duration)[None, :])
