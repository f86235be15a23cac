"""Which bounds of a plane survive challengers, and which cells are driven to learn that.

A bound is what a table calls survived. Where a challenger is not survived, it is lowered until a cell
survives all of them, or until nothing smaller is left. What is driven next depends on the results so far
alone.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from mutator.explore.cell_results import CellResult, CellState
from mutator.explore.challengers import challenger_of
from mutator.explore.lattice import Cell, Lattice
from mutator.explore.plane_map import Line

TABLE_DURATIONS_S = (0.5, 1.0, 2.0)  # for which tables name the largest magnitude that is survived
ChallengedCell = tuple[Cell, str]  # with the name of the challenger


@dataclass(frozen=True, slots=True, kw_only=True)
class Bound:
    """The largest cell up to which a table calls faults survived.

    It is the largest magnitude for every duration up to `duration_s`, or up to the longest that leaves time
    to observe (None); or, if it `is_duration`, the longest duration of the largest magnitude.
    """

    cell: Cell
    duration_s: float | None = None
    is_duration: bool = False

    @property
    def top(self) -> int:
        """The number of its magnitude, or of its duration."""
        return self.cell[1] if self.is_duration else self.cell[0]

    def cell_at(self, level: int) -> Cell:
        return (self.cell[0], level) if self.is_duration else (level, self.cell[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class ChallengedBound:
    """What is left of a bound: the number of the largest magnitude, or longest duration, that was driven and
    survived all challengers, as did all smaller and shorter ones that were driven; None if none did. If it is
    lowered, `challenger` is not survived at `failed`, as `result` shows.
    """

    bound: Bound
    level: int | None
    is_complete: bool
    challenger: str = ""
    failed: Cell | None = None
    result: CellResult | None = None

    @property
    def is_lowered(self) -> bool:
        """Whether less is left, as far as it was looked for to the end."""
        return self.is_complete and self.level != self.bound.top


def survived_lines(cells: Sequence[Line], count: int, *, with_longer: bool = False) -> int:
    """Return how many magnitudes, the smallest ones, are survived for each of the `count` shortest durations
    and, `with_longer`, without a hazard for longer ones.
    """
    for number, line in enumerate(cells):
        longer = line[count:] if with_longer else ()
        if not all(state.is_without_hazard for state in line[:count]) or any(s.is_failed for s in longer):
            return number
    return len(cells)


def survived_durations(line: Line) -> int:
    """Return how many durations, the shortest ones, are survived."""
    return next((j for j, state in enumerate(line) if not state.is_without_hazard), len(line))


def bounds_of(cells: Sequence[Line], lattice: Lattice, decidable: int) -> Iterator[Bound]:
    """Yield the bounds that tables name; none for a fault without a size."""
    if lattice.magnitudes[0] is None:
        return
    durations_s = lattice.durations_s
    for duration_s in (None, *TABLE_DURATIONS_S):
        if duration_s is None:
            count = min(decidable, len(durations_s))
        elif duration_s <= durations_s[-1]:
            count = 1 + next(j for j, other in enumerate(durations_s) if other >= duration_s)
        else:
            continue
        if lines := survived_lines(cells, count, with_longer=duration_s is None):
            yield Bound(cell=(lines - 1, count - 1), duration_s=duration_s)
    if longest := survived_durations(cells[-1]):
        yield Bound(cell=(len(cells) - 1, longest - 1), is_duration=True)


@dataclass(slots=True)
class Challenges:
    """The challenges of a plane's bounds, by `names`, and their results so far. Without bounds, they have not
    begun, or there is nothing to challenge.
    """

    names: Sequence[str]
    lattice: Lattice
    step_s: float
    bounds: Sequence[Bound] = ()
    results: dict[ChallengedCell, CellResult] = field(default_factory=dict)

    def next_cells(self) -> list[ChallengedCell]:
        """Return what to drive next, for all bounds; empty at the end."""
        cells = (cell for bound in self.bounds for cell in self._descent(bound)[1])
        return list(dict.fromkeys(cells))

    def outcomes(self) -> list[ChallengedBound]:
        """Return what is left of each bound."""
        return [self._outcome(bound) for bound in self.bounds]

    def _outcome(self, bound: Bound) -> ChallengedBound:
        has_failed, missing = self._descent(bound)
        survived = [level for level, failed in has_failed.items() if not failed]
        level = max(survived, default=None)
        failed_levels = [n for n, failed in has_failed.items() if failed and (level is None or n > level)]
        if not failed_levels:
            return ChallengedBound(bound=bound, level=level, is_complete=not missing)
        failures = self._failures(bound, min(failed_levels))
        cell, name = min(failures, key=lambda key: self.results[key].state is not CellState.HAZARDOUS)
        return ChallengedBound(
            bound=bound,
            level=level,
            is_complete=not missing,
            challenger=name,
            failed=cell,
            result=self.results[cell, name],
        )

    def _descent(self, bound: Bound) -> tuple[Mapping[int, bool], list[ChallengedCell]]:
        """Return which levels have failed, of those that are decided, and what to drive to go on."""
        has_failed: dict[int, bool] = {}
        while (level := next_level(has_failed, bound.top)) is not None:
            cell, above = bound.cell_at(level), [n for n, failed in has_failed.items() if failed]
            if self._failures(bound, level):
                has_failed[level] = True
                continue
            # what failed before is driven first: the others are needless if it fails here, too
            suspects = [name for _, name in self._failures(bound, min(above))] if above else []
            suspects = [name for name in self._names_at(cell) if name in suspects]
            for names in (suspects, self._names_at(cell)):
                if missing := [(cell, name) for name in names if (cell, name) not in self.results]:
                    return has_failed, missing
            has_failed[level] = False
        return has_failed, []

    def _failures(self, bound: Bound, level: int) -> list[ChallengedCell]:
        """Return the challengers that were driven and not survived, of those that a bound at this level calls
        survived, the smallest and then longest first: also shorter ones, which were driven for other bounds.
        """
        line, duration = bound.cell_at(level)
        failures = (
            ((i, j), name)
            for ((i, j), name), result in self.results.items()
            if result.state is not CellState.WITHOUT_HAZARD
            and j <= duration
            and (i == line or (i < line and not bound.is_duration))
        )
        return sorted(failures, key=lambda key: (key[0][0], -key[0][1], self.names.index(key[1])))

    def _names_at(self, cell: Cell) -> list[str]:
        duration_s = self.lattice.durations_s[cell[1]]
        return [
            name for name in self.names if challenger_of(name).differs_from_constant(duration_s, self.step_s)
        ]


def next_level(has_failed: Mapping[int, bool], top: int) -> int | None:
    """Return the level to look at next: down from the top by strides that double, until one is survived, then
    between that and the lowest that failed above it. None at the end.
    """
    if top not in has_failed:
        return top
    survived = max((level for level, failed in has_failed.items() if not failed), default=-1)
    failed_above = [level for level, failed in has_failed.items() if failed and level > survived]
    if not failed_above or min(failed_above) - survived <= 1:
        return None
    lowest = min(failed_above)
    if survived < 0:
        return max(0, lowest - max(1, top - lowest))
    return (survived + lowest) // 2
