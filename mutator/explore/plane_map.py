"""A plane's cells as far as they are known: driven, inferred, and what lies between such cells."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from mutator.errors import MutatorError
from mutator.explore.cell_results import CellResult, CellState
from mutator.explore.lattice import Cell, Lattice

MOST_DIFFERENCE = 2  # cells by which the ends of two lines may differ for those between them to be drawn

Line = list[CellState]


@dataclass(frozen=True, slots=True)
class Profile:
    """Where a line changes between cells with and without a hazard.

    `starts_hazardous` is the state of the shortest duration. `changes` are the numbers of the first cell
    after each change. A line with cells that are not known between two that differ is not closed.
    """

    starts_hazardous: bool
    changes: tuple[int, ...]
    is_closed: bool

    @property
    def is_simple(self) -> bool:
        """Whether a longer fault is never less dangerous."""
        return self.is_closed and len(self.changes) + self.starts_hazardous <= 1

    def is_hazardous(self, duration: int) -> bool:
        return self.starts_hazardous is not (sum(change <= duration for change in self.changes) % 2 == 1)

    def first_hazardous(self, cell_count: int) -> int:
        """Return the number of the first hazardous cell; `cell_count` if there is none."""
        return 0 if self.starts_hazardous else (*self.changes, cell_count)[0]

    def telling_durations(self, cell_count: int) -> list[int]:
        """Return numbers of durations that tell whether another line is like this one: the middle between two
        changes, and what is beside the first and the last one.
        """
        if not self.changes:
            return []
        middles = [(before + after) // 2 for before, after in pairwise(self.changes)]
        return [self.changes[0] - 1, *middles, min(self.changes[-1], cell_count - 1)]

    def resembles(self, other: "Profile") -> bool:
        """Whether lines between these two can be drawn, without another line in between."""
        return (
            self.is_closed
            and other.is_closed
            and self.starts_hazardous is other.starts_hazardous
            and len(self.changes) == len(other.changes)
            and all(abs(a - b) <= MOST_DIFFERENCE for a, b in zip(self.changes, other.changes, strict=True))
        )


@dataclass(slots=True)
class PlaneMap:
    """The results of a plane's cells, and what follows from them."""

    lattice: Lattice
    results: dict[Cell, CellResult] = field(default_factory=dict)
    # the first inferred cell of a line, and the result from which it follows
    inferring: dict[int, tuple[int, CellResult]] = field(default_factory=dict)
    _decided_by_line: dict[int, list[tuple[int, bool]]] = field(default_factory=dict)  # on demand

    def add(self, cell: Cell, result: CellResult) -> None:
        """Take the result of a cell. MutatorError if it contradicts what follows from a shorter fault."""
        self.results[cell] = result
        line, _ = cell
        self._decided_by_line.pop(line, None)
        if result.inferred_from_s is not None:
            durations = self.lattice.durations_s
            first = next(j for j, duration in enumerate(durations) if duration >= result.inferred_from_s)
            if line not in self.inferring or first < self.inferring[line][0]:
                self.inferring[line] = first, result
        self._check_causality(line)

    def _check_causality(self, line: int) -> None:
        if line not in self.inferring:
            return
        first, proof = self.inferring[line]
        for duration in range(first, len(self.lattice.durations_s)):
            result = self.results.get((line, duration))
            if result and result.is_judged and result.state is not CellState.HAZARDOUS:
                raise MutatorError(
                    f"experiment {result.experiment_id} has no hazard, but the shorter fault of experiment "
                    f"{proof.experiment_id} reached {proof.hazard} while it was active",
                    expected="two runs that are the same up to this hazard",
                    remedy="check that the target is deterministic: `mutator check --drive`",
                )

    def state(self, cell: Cell) -> CellState | None:
        """Return what was driven or inferred; None if neither."""
        if cell in self.results:
            return self.results[cell].state
        line, duration = cell
        if line in self.inferring and duration >= self.inferring[line][0]:
            return CellState.INFERRED
        return None

    def proof_of(self, cell: Cell) -> CellResult | None:
        """Return the result that decides a driven or inferred cell; None for others."""
        if self.state(cell) is CellState.INFERRED:
            return self.inferring[cell[0]][1]
        return self.results.get(cell)

    def decided(self, line: int) -> list[tuple[int, bool]]:
        """Return the decided cells of a line: the number of the duration, and whether it is not survived."""
        if line not in self._decided_by_line:
            states = ((j, self.state((line, j))) for j in range(len(self.lattice.durations_s)))
            self._decided_by_line[line] = [
                (j, state.is_failed) for j, state in states if state and state is not CellState.NOT_DECIDED
            ]
        return self._decided_by_line[line]

    def open_pairs(self, line: int) -> Iterator[tuple[int, int]]:
        """Yield neighbours among the decided cells of a line that differ and have undriven cells between."""
        for (before, was_hazardous), (after, is_hazardous) in pairwise(self.decided(line)):
            between = range(before + 1, after)
            if was_hazardous is not is_hazardous and any(self.state((line, j)) is None for j in between):
                yield before, after

    def profile(self, line: int) -> Profile | None:
        """Return where the line changes; None if nothing of it is decided."""
        decided = self.decided(line)
        if not decided:
            return None
        changes = tuple(after for (_, a), (after, b) in pairwise(decided) if a is not b)
        return Profile(
            starts_hazardous=decided[0][1], changes=changes, is_closed=not any(self.open_pairs(line))
        )

    def cells(self, closed_lines: Sequence[int]) -> list[Line]:
        """Return the state of every cell, by magnitude and duration.

        `closed_lines` are the lines that were searched, ascending. Other lines are drawn between them where
        they resemble each other, a single one as hazardous where one of them is; where not, only cells in
        which both agree.
        """
        lines = [self._driven_line(line) for line in range(len(self.lattice.magnitudes))]
        for line in closed_lines:
            _fill_gaps(lines[line])
        for below, above in pairwise(closed_lines):
            for line in range(below + 1, above):
                self._draw_between(lines, below, line, above)
        return lines

    def _driven_line(self, line: int) -> Line:
        states = (self.state((line, j)) for j in range(len(self.lattice.durations_s)))
        return [state or CellState.UNKNOWN for state in states]

    def _draw_between(self, lines: list[Line], below: int, line: int, above: int) -> None:
        drawn = self.drawn_between(below, line, above)
        for j, state in enumerate(lines[line]):
            if state is not CellState.UNKNOWN:
                continue
            neighbours = lines[below][j], lines[above][j]
            if CellState.UNKNOWN in neighbours or CellState.NOT_DECIDED in neighbours:
                continue
            failed = [neighbour.is_failed for neighbour in neighbours]
            if failed[0] is failed[1] or drawn is not None:
                is_failed = failed[0] if failed[0] is failed[1] or drawn is None else drawn[j]
                lines[line][j] = _between(is_failed, neighbours)

    def drawn_between(self, below: int, line: int, above: int) -> list[bool] | None:
        """Return where a line between two searched ones is called hazardous; None if they do not tell."""
        first, second = self.profile(below), self.profile(above)
        if not (first and second and self.is_drawn_between(below, above)):
            return None
        durations = range(len(self.lattice.durations_s))
        if above - below == 2:  # its cells touch cells of both: hazardous where one of them is, to be safe
            return [first.is_hazardous(j) or second.is_hazardous(j) for j in durations]
        share = (line - below) / (above - below)
        changes = [round(a + share * (b - a)) for a, b in zip(first.changes, second.changes, strict=True)]
        drawn = Profile(first.starts_hazardous, tuple(changes), is_closed=True)
        return [drawn.is_hazardous(j) for j in durations]

    def first_hazardous(self, line: int) -> int:
        """Return the number of the first hazardous duration of a searched line; their count without one."""
        profile = self.profile(line)
        count = len(self.lattice.durations_s)
        return profile.first_hazardous(count) if profile else count

    def is_drawn_between(self, below: int, above: int) -> bool:
        """Whether what lies between two searched lines follows from them, without another line in between.

        One line between two simple ones with a hazard does, however they differ.
        """
        first, second = self.profile(below), self.profile(above)
        if first is None or second is None:
            return False
        if first.resembles(second):
            return True
        last_hazardous = max(self.first_hazardous(below), self.first_hazardous(above))
        are_simple = first.is_simple and second.is_simple and last_hazardous < len(self.lattice.durations_s)
        return above - below == 2 and are_simple


def _between(is_failed: bool, neighbours: Sequence[CellState]) -> CellState:
    """Return the state of a cell between neighbours; unknown beside one in which the controller disengaged,
    because a hazard may follow there.
    """
    if not is_failed:
        return CellState.BETWEEN_WITHOUT
    return CellState.UNKNOWN if CellState.DISENGAGED in neighbours else CellState.BETWEEN_HAZARDOUS


def _fill_gaps(line: Line) -> None:
    """Fill what lies between two decided cells that agree, shorter durations than the first one, and longer
    ones than a hazardous last one.
    """
    decided = [
        (j, state.is_failed)
        for j, state in enumerate(line)
        if state not in (CellState.UNKNOWN, CellState.NOT_DECIDED)
    ]
    if not decided:
        return
    for (before, was_failed), (after, is_failed) in pairwise([(-1, decided[0][1]), *decided]):
        if was_failed is is_failed and CellState.NOT_DECIDED not in line[before + 1 : after]:
            state = _between(is_failed, (line[max(before, 0)], line[after]))
            line[before + 1 : after] = [state] * (after - before - 1)
    last, is_last_failed = decided[-1]
    if is_last_failed and CellState.NOT_DECIDED not in line[last:]:
        line[last + 1 :] = [_between(True, line[last : last + 1])] * (len(line) - last - 1)
