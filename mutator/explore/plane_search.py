"""Which cells of a plane to drive next, from the results so far: a pure function on whole numbers.

Some lines (magnitudes) are swept: their durations are tried at equal distances, because a hazard is monotone
in nothing. Between two cells that differ, bisection finds the neighbours that do. Lines between two that
differ too much follow: they begin where their neighbours let expect the change.
"""

from bisect import bisect
from collections import Counter
from collections.abc import Iterable, Iterator, Set
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf
from typing import TypeAlias

from mutator.explore.cell_results import CellState
from mutator.explore.hidden_islands import places_to_look
from mutator.explore.lattice import Cell
from mutator.explore.plane_map import MOST_DIFFERENCE, PlaneMap, Profile

# the number of a duration at which a line may change, or those to drive first; None: sweep the line
Guess: TypeAlias = int | tuple[int, ...] | None

SWEPT_LINES, LEAST_SWEPT_DURATIONS, _CELLS_TO_SWEEP = 7, 8, 56


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaneSearch:
    """The search of one plane.

    `decidable` is how many durations, the shortest ones, leave time to observe what follows in the drive.
    `repaired_lines` are swept in addition, because a validation failed there.
    """

    plane: PlaneMap
    decidable: int
    repaired_lines: Set[int] = field(default_factory=frozenset)

    def closed_lines(self) -> list[int]:
        """Return the lines whose search is over, ascending."""
        lines = self._lines()
        return sorted(line for line, guess in lines.items() if not self._next_in_line(line, guess))

    @property
    def is_closed(self) -> bool:
        """Whether the search of every line is over."""
        return not any(self._next_in_line(line, guess) for line, guess in self._lines().items())

    def proposals(self) -> list[Cell]:
        """Return cells to drive, the most telling ones first; empty once the search is over."""
        lines = self._lines()
        by_line = [self._next_in_line(line, guess) for line, guess in lines.items()]
        if any(by_line):
            return list(dict.fromkeys(cell for cells in by_line for cell in cells))
        near_misses = (cell for line in lines for cell in self._near_misses(line))
        places = places_to_look(self.plane, self.plane.cells(sorted(lines)), self.decidable)
        return list(dict.fromkeys([*near_misses, *places]))

    def _lines(self) -> dict[int, Guess]:
        """Return the lines to search, each with where it is expected to change.

        Lines between others follow once these are closed, and then those that a hazard shows to be unlike
        their neighbours.
        """
        last = len(self.plane.lattice.magnitudes) - 1
        swept = {*_spread(last + 1, SWEPT_LINES), *self.repaired_lines}
        while True:
            lines = self._lines_around(swept)
            if any(self._next_in_line(line, guess) for line, guess in lines.items()):
                return lines
            surprising = self._surprising_lines(sorted(lines))
            if not surprising:
                return lines
            swept |= surprising

    def _lines_around(self, swept: Set[int]) -> dict[int, Guess]:
        # the largest magnitude first, then from both sides towards the middle: it may well be the end
        lines: dict[int, Guess] = dict.fromkeys(sorted(swept, reverse=True))
        if not any(self._next_in_line(line, None) for line in swept):
            for below, above in pairwise(sorted(swept)):
                lines |= self._lines_between(below, above)
        return lines

    def _surprising_lines(self, searched: list[int]) -> set[int]:
        """Return the other lines with a hazard where the searched ones let expect none."""
        return {
            line
            for (line, duration), result in self.plane.results.items()
            if result.state is CellState.HAZARDOUS
            and line not in searched
            and not self._is_expected(searched, line, duration)
        }

    def _is_expected(self, searched: list[int], line: int, duration: int) -> bool:
        position = bisect(searched, line)
        drawn = self.plane.drawn_between(searched[position - 1], line, searched[position])
        return drawn is None or any(drawn[max(0, duration - MOST_DIFFERENCE) :][: 2 * MOST_DIFFERENCE + 1])

    def _lines_between(self, below: int, above: int) -> dict[int, Guess]:
        first, second = self.plane.profile(below), self.plane.profile(above)
        if above - below < 2 or not first or not second or self.plane.is_drawn_between(below, above):
            return {}
        middle = self._middle_line(below, above)
        guess = self._expected_change(first, second)
        lines = {middle: guess}
        if not self._next_in_line(middle, guess):
            lines |= self._lines_between(below, middle) | self._lines_between(middle, above)
        return lines

    def _middle_line(self, below: int, above: int) -> int:
        """Return the line nearest to the middle, of those that were searched before if there are any."""
        counts = Counter(line for line, _ in self.plane.results if below < line < above)
        searched = [line for line, count in counts.items() if count > 1 and any(self.plane.decided(line))]
        return min(searched or range(below + 1, above), key=lambda i: (abs(2 * i - below - above), i))

    def _expected_change(self, first: Profile, second: Profile) -> Guess:
        """Return the number of the duration at which a line between two simple ones may change; durations
        that show whether a line is like one of two others.
        """
        count = len(self.plane.lattice.durations_s)
        if not (first.is_simple and second.is_simple):
            return tuple(sorted({*first.telling_durations(count), *second.telling_durations(count)}))
        ends = first.first_hazardous(count), second.first_hazardous(count)
        # without any change in one of them, the line may have none, which only a sweep shows
        return (sum(ends) + 1) // 2 if max(ends) < self.decidable else None

    def _next_in_line(self, line: int, guess: Guess) -> list[Cell]:
        if guess is None:
            return self._next_in_sweep(line)
        if isinstance(guess, tuple):
            around = [(line, j) for j in guess if j < self.decidable]
            return self._undriven(around) or self._bisections(line)
        around = [(line, j) for j in (guess, guess - 1) if j >= 0]
        missing = self._undriven(around)
        if missing or len({is_hazardous for _, is_hazardous in self.plane.decided(line)}) != 1:
            return missing or self._bisections(line)
        return self._next_outward(line, guess)

    def _undriven(self, cells: Iterable[Cell]) -> list[Cell]:
        return [cell for cell in cells if self.plane.state(cell) is None]

    def _next_outward(self, line: int, guess: int) -> list[Cell]:
        """Return the next cell of a line that does not change where its neighbours let expect it, at growing
        distances from there.
        """
        if self.plane.decided(line)[0][1]:  # hazardous, so it changes at shorter durations, if at all
            durations = [*range_doubling(guess - 1, -1, 0), 0]
            return self._undriven((line, j) for j in durations)[:1]
        longest = self.plane.lattice.largest[1]
        durations = [*range_doubling(guess, 1, longest), longest]
        return self._undriven((line, j) for j in durations)[:1] or self._next_in_sweep(line)

    def _next_in_sweep(self, line: int) -> list[Cell]:
        longest = (line, self.plane.lattice.largest[1])
        if self.plane.state(longest) is None:
            return [longest]
        sweep = [(line, j) for j in _spread(self.decidable, self._swept_durations)]
        return self._undriven(sweep) or self._bisections(line)

    @property
    def _swept_durations(self) -> int:
        """How many durations of a line are tried: more where there are few lines."""
        line_count = min(len(self.plane.lattice.magnitudes), SWEPT_LINES)
        return max(LEAST_SWEPT_DURATIONS, _CELLS_TO_SWEEP // line_count)

    def _bisections(self, line: int) -> list[Cell]:
        """Return cells between decided ones that differ; then the shortest one, if the first decided one is
        hazardous: nothing says yet that shorter faults are.
        """
        cells = [self._middle(line, before, after) for before, after in self.plane.open_pairs(line)]
        begins_hazardous = any(is_hazardous for _, is_hazardous in self.plane.decided(line)[:1])
        return cells or (self._undriven([(line, 0)]) if begins_hazardous else [])

    def _middle(self, line: int, before: int, after: int) -> Cell:
        """Return the undriven cell next to the middle."""
        free = (j for j in range(before + 1, after) if self.plane.state((line, j)) is None)
        return line, min(free, key=lambda j: (abs(2 * j - before - after), j))

    def _near_misses(self, line: int) -> list[Cell]:
        """Return cells beside the smallest margin of a line without any hazard, where one may hide."""
        decided = self.plane.decided(line)
        if any(is_hazardous for _, is_hazardous in decided):
            return []
        cells: list[Cell] = []
        for (a, _), (b, _), (c, _) in zip(decided, decided[1:], decided[2:], strict=False):
            if self._has_least_margin(line, a, b, c):
                cells += [
                    self._middle(line, *pair) for pair in ((a, b), (b, c)) if self._is_free(line, *pair)
                ]
        return cells

    def _is_free(self, line: int, before: int, after: int) -> bool:
        return any(self.plane.state((line, j)) is None for j in range(before + 1, after))

    def _has_least_margin(self, line: int, before: int, middle: int, after: int) -> bool:
        margins = [self.plane.results[line, j].margins for j in (before, middle, after)]
        return any(
            value < min(beside.get(name, inf) for beside in (margins[0], margins[2]))
            for name, value in margins[1].items()
        )


def _spread(count: int, points: int) -> list[int]:
    """Return at most `points` numbers below `count` at equal distances, both ends included."""
    if count <= points:
        return list(range(count))
    return [(i * (count - 1) + (points - 1) // 2) // (points - 1) for i in range(points)]


def range_doubling(begin: int, direction: int, end: int) -> Iterator[int]:
    """Yield numbers before `end` at distances of 2, 4, 8 ... from `begin`."""
    distance = 2
    while (number := begin + direction * distance) * direction < end * direction:
        yield number
        distance *= 2


def cells_with(states: Iterable[CellState], lines: list[list[CellState]]) -> Iterator[Cell]:
    """Yield the cells with one of these states, by magnitude and duration."""
    selected = frozenset(states)
    for i, line in enumerate(lines):
        for j, state in enumerate(line):
            if state in selected:
                yield i, j
