"""Envelopes: what a finished exploration says of each plane."""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import copysign
from typing import Any

from mutator.campaigns.exploration_section import ExploredPlane
from mutator.explore.cell_results import CellResult, CellState, Drive
from mutator.explore.challenges import ChallengedBound, survived_durations, survived_lines
from mutator.explore.lattice import Cell
from mutator.explore.plane_exploration import PlaneExploration, Validation
from mutator.explore.plane_map import Line

CODE_BY_STATE = {
    CellState.HAZARDOUS: "H",
    CellState.WITHOUT_HAZARD: "o",
    CellState.DISENGAGED: "d",
    CellState.NOT_DECIDED: "?",
    CellState.INFERRED: "h",
    CellState.BETWEEN_HAZARDOUS: "+",
    CellState.BETWEEN_WITHOUT: ".",
    CellState.UNKNOWN: " ",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class BoundaryPair:
    """Neighbours on a line of a plane, the longest duration that is survived and the next one. Each has the
    experiment that shows it, which for an inferred hazard is a shorter one.
    """

    without_hazard: CellResult
    hazardous: CellResult


@dataclass(frozen=True)
class Envelope:
    """What faults of one kind do in one scenario from one start on, by magnitude and duration."""

    exploration: PlaneExploration  #: the plane's search and validations

    @property
    def plane(self) -> ExploredPlane:
        """What was asked for."""
        return self.exploration.plane

    @property
    def drive(self) -> Drive:
        """When the fault starts, and when the drive ends, in s."""
        return self.exploration.drive

    @property
    def durations_s(self) -> tuple[float, ...]:
        """How long the fault lasts, in s, ascending."""
        return self.exploration.map.lattice.durations_s

    @property
    def magnitudes(self) -> tuple[float | None, ...]:
        """The magnitudes; None for a fault without a value."""
        return self.exploration.map.lattice.magnitudes

    @cached_property
    def cells(self) -> list[Line]:
        """The state of each cell, by magnitude and duration."""
        return self.exploration.cells()

    @property
    def was_active(self) -> bool:
        """Whether the fault was active in any run."""
        return any(result.is_activated for result in self.exploration.map.results.values())

    @property
    def run_count(self) -> int:
        """The number of cells that were driven."""
        return len(self.exploration.map.results)

    @property
    def validation(self) -> Validation | None:
        """The newest validation; None without one."""
        return self.exploration.validations[-1] if self.exploration.validations else None

    @property
    def longest_tried_s(self) -> float:
        """The longest duration that leaves time to observe what follows, in s."""
        return self.durations_s[self.columns_up_to() - 1]

    def survives(self, magnitude: float | None, duration_s: float) -> bool:
        """Return whether the cell that is at least as large and long as this fault is called without hazard.

        False does not mean a hazard: `state_at` says why.
        """
        return self.state_at(magnitude, duration_s).is_without_hazard

    def state_at(self, magnitude: float | None, duration_s: float) -> CellState:
        """Return the state of the cell that is at least as large and long as this fault; unknown if it is
        larger or longer than any.
        """
        line = self._first_line_at_least(magnitude)
        duration = _first_at_least(self.durations_s, duration_s)
        return CellState.UNKNOWN if line is None or duration is None else self.cells[line][duration]

    def _first_line_at_least(self, magnitude: float | None) -> int | None:
        """None for another sign, too, and for a magnitude where the fault has no value, or the reverse."""
        if magnitude is None or self.magnitudes[0] is None:
            return 0 if magnitude is self.magnitudes[0] else None
        sizes = [value / copysign(1.0, magnitude) for value in self.magnitudes if value is not None]
        return _first_at_least(sizes, abs(magnitude))

    def longest_survived_s(self, line: int) -> float | None:
        """Return the longest duration up to which all of a line are without hazard; None if the shortest is
        not.
        """
        count = survived_durations(self.cells[line])
        return self.durations_s[count - 1] if count else None

    def shortest_hazardous_s(self, line: int) -> float | None:
        """Return the shortest duration of a line that is hazardous; None without one."""
        return next(
            (d for d, state in zip(self.durations_s, self.cells[line], strict=True) if state.is_hazardous),
            None,
        )

    def columns_up_to(self, duration_s: float | None = None) -> int:
        """Return the number of durations up to the first one that is at least as long, by default of those
        that leave time to observe what follows.
        """
        if duration_s is None:
            return min(self.exploration.decidable, len(self.durations_s))
        first = _first_at_least(self.durations_s, duration_s)
        return len(self.durations_s) if first is None else first + 1

    def largest_survived(self, duration_s: float | None = None) -> float | None:
        """Return the magnitude up to which all are survived for every duration up to this one (that of the
        first cell that is at least as long), by default for every duration that leaves time to observe what
        follows, and without a hazard for longer ones; None if the smallest is not, or if no cell is as long.
        """
        if duration_s is not None and duration_s > self.durations_s[-1]:
            return None
        count = self.columns_up_to(duration_s)
        lines = survived_lines(self.cells, count, with_longer=duration_s is None)
        return self.magnitudes[lines - 1] if lines else None

    @property
    def is_challenged(self) -> bool:
        """Whether the plane has challengers, and bounds that were challenged or will be."""
        return bool(self.plane.challengers)

    @cached_property
    def challenges(self) -> list[ChallengedBound]:
        """What challengers left of each bound; empty if they have not begun."""
        return self.exploration.challenges.outcomes()

    def challenged(self, duration_s: float | None = None) -> ChallengedBound | None:
        """Return what challengers left of `largest_survived(duration_s)`; None if it was not challenged."""
        return next(
            (c for c in self.challenges if not c.bound.is_duration and c.bound.duration_s == duration_s), None
        )

    def challenged_longest(self) -> ChallengedBound | None:
        """Return what challengers left of the longest survived duration of the largest magnitude; None if it
        was not challenged.
        """
        return next((c for c in self.challenges if c.bound.is_duration), None)

    def time_to_hazard_s(self, line: int) -> float | None:
        """Return the time to the hazard of the longest fault of a line that was driven to one."""
        results = self.exploration.map.results
        driven = (results.get((line, j)) for j in reversed(range(len(self.durations_s))))
        return next((r.time_to_hazard_s for r in driven if r and r.state is CellState.HAZARDOUS), None)

    def boundary_pair(self, line: int) -> BoundaryPair | None:
        """Return the boundary of a line, if both sides of it are driven or inferred."""
        for j, state in enumerate(self.cells[line][:-1]):
            after = self.cells[line][j + 1]
            if state is CellState.WITHOUT_HAZARD and after in (CellState.HAZARDOUS, CellState.INFERRED):
                before_result = self.exploration.map.results[line, j]
                proof = self.exploration.map.proof_of((line, j + 1))
                assert proof is not None
                return BoundaryPair(without_hazard=before_result, hazardous=proof)
        return None

    def islands(self) -> list[list[Cell]]:
        """Return the groups of hazardous cells that are not connected with the largest group."""
        hazardous = {
            (i, j) for i, line in enumerate(self.cells) for j, s in enumerate(line) if s.is_hazardous
        }
        groups = sorted(_connected_groups(hazardous), key=lambda group: (-len(group), group[0]))
        return groups[1:]

    def as_json(self) -> dict[str, Any]:
        """Convert to JSON types. A cell is a letter (`CODE_BY_STATE`); a line has one for each duration."""
        return {
            "spec": self.plane.spec,
            "scenario": self.plane.scenario,
            "start": self.plane.start,
            "start_s": self.drive.start_s,
            "end_s": self.drive.end_s,
            "seed": self.plane.seed,
            "seeds": self.plane.seeds,
            "unit": self.plane.unit,
            "magnitudes": list(self.plane.magnitudes),
            "durations_s": list(self.durations_s),
            "cells": ["".join(CODE_BY_STATE[state] for state in line) for line in self.cells],
            "runs": self.run_count,
            "longest_survived_s": [self.longest_survived_s(i) for i in range(len(self.magnitudes))],
            "time_to_hazard_s": [self.time_to_hazard_s(i) for i in range(len(self.magnitudes))],
            "pairs": [_pair_as_json(self.boundary_pair(i)) for i in range(len(self.magnitudes))],
            "validations": [
                {
                    "frame": validation.frame_size,
                    "drawn": [list(cell) for cell in validation.drawn],
                    "hazardous": [list(cell) for cell in self.exploration.failures(validation)],
                }
                for validation in self.exploration.validations
            ],
            "challengers": list(self.plane.challengers),
            "challenges": [self._challenge_as_json(challenge) for challenge in self.challenges],
        }

    def _challenge_as_json(self, challenge: ChallengedBound) -> Mapping[str, Any]:
        """Return a bound before and after its challengers, as cells; and the run that lowers it."""
        bound = challenge.bound
        return {
            "bound": "longest" if bound.is_duration else bound.duration_s or "every duration",
            "constant": list(bound.cell),
            "survived": None if challenge.level is None else list(bound.cell_at(challenge.level)),
            "complete": challenge.is_complete,
            "challenger": challenge.challenger,
            "failed": list(challenge.failed) if challenge.failed else None,
            "experiment": challenge.result.experiment_id if challenge.result else None,
        }


def _pair_as_json(pair: BoundaryPair | None) -> Mapping[str, Any] | None:
    if pair is None:
        return None
    return {"without_hazard": pair.without_hazard.experiment_id, "hazardous": pair.hazardous.experiment_id}


def _first_at_least(values: Sequence[float], value: float) -> int | None:
    return next((i for i, other in enumerate(values) if other >= value), None)


def _connected_groups(cells: set[Cell]) -> Iterator[list[Cell]]:
    """Yield groups of cells that touch each other, also at corners."""
    remaining = set(cells)
    for start in sorted(cells):
        if start not in remaining:
            continue
        remaining.discard(start)
        group, queue = [start], deque([start])
        while queue:
            i, j = queue.popleft()
            beside = {(i + a, j + b) for a in (-1, 0, 1) for b in (-1, 0, 1)} & remaining
            remaining -= beside
            group += sorted(beside)
            queue += sorted(beside)
        yield sorted(group)
