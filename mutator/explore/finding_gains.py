"""What a search for findings can expect of each cell of a plane.

The larger and the longer a fault is, the more dangerous it is taken to be. This is no truth (see
`PlaneSearch`), but a guide to where a run tells most.
"""

from dataclasses import dataclass, field

import numpy as np

from mutator.explore.lattice import Cell, Lattice

_FINDING_GAIN = 0.4  # of the first hazard of a plane, as a share of the plane's cells


@dataclass(slots=True)
class FaultShape:
    """Where planes of the same fault that have a hazard are hazardous, as numbers of planes for each cell."""

    lattice: Lattice
    _hazardous: np.ndarray = field(init=False)
    _without: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        shape = _array_shape(self.lattice)
        self._hazardous, self._without = np.zeros(shape, dtype=int), np.zeros(shape, dtype=int)

    def count(self, plane: "PlaneGains", sign: int) -> None:
        """Add what is known of a plane, with `sign` 1, or take it back, with -1."""
        if plane.has_hazard:
            self._hazardous += sign * plane.is_hazardous
            self._without += sign * (plane.is_without & ~plane.is_hazardous)

    def chances(self) -> np.ndarray:
        """Return the estimated chance that a plane with a hazard has one in a cell. It never falls with
        magnitude and duration.
        """
        lines, durations = self._hazardous.shape
        before_any_result = np.outer(np.arange(1, lines + 1), np.arange(1, durations + 1)) / self.lattice.size
        chances = (self._hazardous + before_any_result) / (self._hazardous + self._without + 1)
        return np.maximum.accumulate(np.maximum.accumulate(chances, axis=0), axis=1)


@dataclass(slots=True)
class PlaneGains:
    """What is known of a plane: cells at least as large and long as a hazardous one, and cells at most as
    large and long as one without a hazard. Cells without a result yet count as without hazard, so that
    several runs of a plane at once are not the same.
    """

    lattice: Lattice
    is_hazardous: np.ndarray = field(init=False)
    is_without: np.ndarray = field(init=False)
    is_driven: np.ndarray = field(init=False)  # or inferred
    awaited: set[Cell] = field(default_factory=set)

    def __post_init__(self) -> None:
        shape = _array_shape(self.lattice)
        self.is_hazardous, self.is_without, self.is_driven = (np.zeros(shape, dtype=bool) for _ in range(3))

    @property
    def has_hazard(self) -> bool:
        return bool(self.is_hazardous.any())

    def note(self, cell: Cell, first_hazardous: int | None) -> None:
        """Take the result of a cell: the first hazardous duration of its line that follows from it."""
        line, duration = cell
        self.awaited.discard(cell)
        self.is_driven[cell] = True
        if first_hazardous is None:
            self.is_without[: line + 1, : duration + 1] = True
        else:
            self.is_driven[line, first_hazardous:] |= first_hazardous < duration
            self.is_hazardous[line:, first_hazardous:] = True

    def best(self, chances: np.ndarray, promise: float) -> tuple[float, Cell]:
        """Return the expected gain of the best cell, 0 if no cell is expected to tell anything, and the cell.

        `chances` are those of the fault; `promise` is the estimated chance that the plane has a hazard.
        """
        gains = self._chances_here(chances, promise) * self._new_shares()
        gains[self.is_driven | self.is_hazardous] = 0.0
        line, duration = divmod(int(gains.argmax()), gains.shape[1])
        return float(gains[line, duration]), (line, duration)

    def _chances_here(self, chances: np.ndarray, promise: float) -> np.ndarray:
        """Return the chances of a hazard in each cell, given what is known of smaller and of larger ones."""
        if not self.has_hazard:
            chances = chances * promise
        low = np.where(self._is_without_or_awaited(), chances, 0.0)
        low = np.maximum.accumulate(np.maximum.accumulate(low, axis=0), axis=1)
        high = np.where(self.is_hazardous, chances, 1.0)[::-1, ::-1]
        high = np.minimum.accumulate(np.minimum.accumulate(high, axis=0), axis=1)[::-1, ::-1]
        return np.where(high > low, np.maximum(chances - low, 0.0) / np.maximum(high - low, 1e-9), 0.0)

    def _is_without_or_awaited(self) -> np.ndarray:
        is_without = self.is_without.copy()
        for line, duration in self.awaited:
            is_without[: line + 1, : duration + 1] = True
        return is_without

    def _new_shares(self) -> np.ndarray:
        """Return for each cell the share of cells that a hazard in it adds to the hazardous ones."""
        added = (~self.is_hazardous)[::-1, ::-1].cumsum(axis=0).cumsum(axis=1)[::-1, ::-1] / self.lattice.size
        return added if self.has_hazard else added + _FINDING_GAIN

    def spare_cell(self) -> Cell | None:
        """Return the largest cell that was neither driven nor inferred; None without one."""
        free = ~self.is_driven
        for cell in self.awaited:
            free[cell] = False
        if not free.any():
            return None
        line, duration = divmod(int(np.flatnonzero(free)[-1]), free.shape[1])
        return line, duration


def _array_shape(lattice: Lattice) -> tuple[int, int]:
    return len(lattice.magnitudes), len(lattice.durations_s)
