"""Which envelopes of two explorations got smaller, plane by plane."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from mutator._common.message_text import counted
from mutator.comparison.paired_rate_and_time_sheets import RunDisplayNames
from mutator.explore.cell_results import CellResult, CellState
from mutator.explore.challenges import ChallengedBound
from mutator.explore.envelope import Envelope
from mutator.explore.envelope_failures import nearest_hazardous_result, nearest_undecided_result
from mutator.explore.envelope_texts import magnitude_text, name_of_plane
from mutator.explore.lattice import Cell
from mutator.statistics.statistics_sheet import Sheet

EnvelopesOfEachRun = tuple[Sequence[Envelope], Sequence[Envelope]]
_PlaneKey = tuple[str, str, str, bool, int]  # spec, scenario, start, sign, seed
_MOST_NAMED_PLANES = 5
_COMPARED = ("magnitudes", "durations in s", "starts in s", "observation times in s")
_CellValues = tuple[float | None, float]  # magnitude, duration


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvelopeChange:
    """A plane of two runs. `decided` is the number of cells of which both runs say what follows.

    `became_undecided` counts cells that the first run calls without hazard, and of which the second says
    nothing, although their faults leave time to observe in the first. `evidence` is a run of the second: for
    the smallest, shortest fault that became hazardous the run that proves it, or the nearest hazardous one if
    none does; otherwise the run without a result that is nearest to what became undecided, or else that of
    the challenger of the first of the `lowered_bounds`, which challengers left smaller than in the first
    run; None without any.
    """

    a: Envelope
    b: Envelope
    decided: int
    became_hazardous: int
    became_safe: int
    became_undecided: int
    lowered_bounds: int
    evidence: CellResult | None

    @property
    def is_smaller(self) -> bool:
        """Whether the second run no longer calls something without hazard, and a run shows why."""
        return self.evidence is not None

    @property
    def mismatch(self) -> str:
        """Why the envelopes cannot be compared cell by cell; empty if they can."""
        for name, before, after in zip(_COMPARED, _compared(self.a), _compared(self.b), strict=True):
            if before != after:
                values = f"{_range_text(before)} and {_range_text(after)}"
                return f"{name_of_plane(self.b)}: {name} differ ({values})"
        return ""

    @property
    def text(self) -> str:
        return (
            f"{name_of_plane(self.b)}: {counted(self.became_hazardous, 'cell')} of {self.decided} became "
            f"hazardous, {self.became_safe} no longer are, {self.became_undecided} no longer decided"
            + (f"; challengers lower {counted(self.lowered_bounds, 'bound')}" if self.lowered_bounds else "")
        )


def compare_envelopes(envelopes: EnvelopesOfEachRun) -> tuple[EnvelopeChange, ...]:
    """Return the planes that both runs have, in the order of the second run."""
    before = {_key(envelope): envelope for envelope in envelopes[0]}
    pairs = ((before.get(_key(envelope)), envelope) for envelope in envelopes[1])
    return tuple(_change(a, b) for a, b in pairs if a is not None)


def planes_only_in(mine: Sequence[Envelope], others: Sequence[Envelope]) -> list[Envelope]:
    """Return the planes that only the first of two runs has begun."""
    keys = set(map(_key, others))
    return [envelope for envelope in mine if _key(envelope) not in keys]


def remarks_on_planes(envelopes: EnvelopesOfEachRun, names: RunDisplayNames) -> Iterator[str]:
    """Yield a remark on the planes that only one of the runs has."""
    a, b = envelopes
    for name, only in ((names.a, planes_only_in(a, b)), (names.b, planes_only_in(b, a))):
        if only:
            listed = ", ".join(map(name_of_plane, only[:_MOST_NAMED_PLANES]))
            rest = len(only) - _MOST_NAMED_PLANES
            yield f"Only {name} has explored: {listed}{f', and {rest} more' if rest > 0 else ''}."


def describe_envelope_changes(changes: Sequence[EnvelopeChange]) -> str:
    """Return how many envelopes got smaller; empty if there are none to compare."""
    if not changes:
        return ""
    smaller = sum(change.is_smaller for change in changes)
    return f"Of {counted(len(changes), 'envelope')}, {smaller} got smaller."


def envelopes_sheet(changes: Sequence[EnvelopeChange], names: RunDisplayNames) -> Sheet:
    heads = (
        *("plane", "cells decided in both", "became hazardous", "no longer hazardous", "no longer decided"),
        *(f"survived for every duration, {name}" for name in (names.a, names.b)),
        "smaller",
    )
    lines = tuple(
        (
            name_of_plane(change.b),
            change.decided,
            change.became_hazardous,
            change.became_safe,
            change.became_undecided,
            _largest_survived_text(change.a),
            _largest_survived_text(change.b),
            "yes" if change.is_smaller else "no",
        )
        for change in changes
    )
    note = (
        "Cells of which both runs say whether a hazard follows, with those between runs. An envelope is "
        f"smaller if a cell that {names.a} calls without hazard, driven or between runs, is hazardous in "
        f"{names.b}, or not decided because runs there have no result or ended disengaged, or if challengers "
        "leave less of what is survived."
    )
    return Sheet(name="envelopes", title="What is survived", note=note, heads=heads, lines=lines)


def _key(envelope: Envelope) -> _PlaneKey:
    plane = envelope.plane
    is_negative = (envelope.magnitudes[0] or 0.0) < 0
    return plane.spec, plane.scenario, plane.start, is_negative, plane.seed


def _change(a: Envelope, b: Envelope) -> EnvelopeChange:
    before, observed = _state_by_values(a), set(a.durations_s[: a.columns_up_to()])
    decided = became_safe = 0
    became_hazardous: list[Cell] = []
    became_undecided: list[Cell] = []
    for i, j, values in _cells(b):
        was, now = before.get(values, CellState.UNKNOWN), b.cells[i][j]
        if not (now.is_hazardous or now.is_without_hazard):
            if was.is_without_hazard and values[1] in observed:
                became_undecided.append((i, j))
        elif was.is_hazardous or was.is_without_hazard:
            decided += 1
            became_safe += was.is_hazardous and now.is_without_hazard
            if was.is_without_hazard and now.is_hazardous:
                became_hazardous.append((i, j))
    lowered = list(_lowered_bounds(a, b))
    evidence = _evidence(b, became_hazardous, became_undecided)
    return EnvelopeChange(
        a=a,
        b=b,
        decided=decided,
        became_hazardous=len(became_hazardous),
        became_safe=became_safe,
        became_undecided=len(became_undecided),
        lowered_bounds=len(lowered),
        evidence=evidence or next((challenge.result for challenge in lowered), None),
    )


def _lowered_bounds(a: Envelope, b: Envelope) -> Iterator[ChallengedBound]:
    """Yield the bounds that challengers left smaller in the second run, if both have the same challengers."""
    if a.plane.challengers != b.plane.challengers:
        return
    before = {(c.bound.is_duration, c.bound.duration_s): c for c in a.challenges if c.is_complete}
    for challenge in b.challenges:
        earlier = before.get((challenge.bound.is_duration, challenge.bound.duration_s))
        if earlier and challenge.is_lowered and _size_left(b, challenge) < _size_left(a, earlier):
            yield challenge


def _size_left(envelope: Envelope, challenge: ChallengedBound) -> float:
    if challenge.level is None:
        return 0.0
    values = envelope.durations_s if challenge.bound.is_duration else envelope.magnitudes
    return abs(values[challenge.level] or 0.0)


def _evidence(b: Envelope, hazardous: Sequence[Cell], undecided: Sequence[Cell]) -> CellResult | None:
    if hazardous:
        proofs = (b.exploration.map.proof_of(cell) for cell in hazardous)
        return next(filter(None, proofs), None) or nearest_hazardous_result(b, hazardous[0])
    return nearest_undecided_result(b, undecided[0]) if undecided else None


def _compared(envelope: Envelope) -> tuple[tuple[float | None, ...], ...]:
    """Return what two envelopes must have in common, in the order of `_COMPARED`."""
    observe_s = envelope.exploration.section.observe_s
    return envelope.magnitudes, envelope.durations_s, (envelope.drive.start_s,), (observe_s,)


def _range_text(values: Sequence[float | None]) -> str:
    first, last = values[0], values[-1]
    if first is None or last is None:
        return "none"
    return f"{first:g}" if len(values) == 1 else f"{len(values)} values from {first:g} to {last:g}"


def _state_by_values(envelope: Envelope) -> Mapping[_CellValues, CellState]:
    return {values: envelope.cells[i][j] for i, j, values in _cells(envelope)}


def _cells(envelope: Envelope) -> Iterator[tuple[int, int, _CellValues]]:
    for i, magnitude in enumerate(envelope.magnitudes):
        for j, duration_s in enumerate(envelope.durations_s):
            yield i, j, (magnitude, duration_s)


def _largest_survived_text(envelope: Envelope) -> str:
    survived = envelope.largest_survived()
    return "-" if survived is None else magnitude_text(envelope, survived)
