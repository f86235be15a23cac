"""Matches the experiments of two runs and classifies the changes in each pair."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

from mutator.comparison.compared_runs import Side, key_of
from mutator.model import Experiment, Outcome, Status
from mutator.results.result_rows import Row

_HARM = {Outcome.NOT_ACTIVATED: 0, Outcome.MASKED: 0, Outcome.SDC: 1, Outcome.HAZARD: 2}
_TIME_DIGITS = 6  # decimals of a time from activation; absorbs rounding errors


class Change(StrEnum):
    """A change in the second run of a pair, relative to the first. `comparison.Gate` explains the changes for
    the worse.
    """

    NEW_HAZARD = "new-hazard"
    OTHER_HAZARD = "other-hazard"
    HIGHER_SEVERITY = "higher-severity"
    HAZARD_GONE = "hazard-gone"
    LOWER_SEVERITY = "lower-severity"
    EARLIER_HAZARD = "earlier-hazard"
    LATER_HAZARD = "later-hazard"
    LOST_ALERT = "lost-alert"
    NEW_ALERT = "new-alert"
    WORSE = "worse"
    BETTER = "better"
    NEW_CRASH = "new-crash"
    CRASH_GONE = "crash-gone"
    HARNESS_ERROR = "harness-error"
    MENDED = "mended"  # a result, although the first run has none
    OTHERWISE = "otherwise"  # another outcome that is neither better nor worse: masked or not activated


@dataclass(frozen=True)
class Pair:
    """One experiment in both runs, with its rows."""

    a: Experiment
    b: Experiment
    row_a: Row
    row_b: Row

    @property
    def usable(self) -> bool:
        """Whether both runs have a valid result for the fault."""
        return self.row_a.usable and self.row_b.usable

    @cached_property
    def changes(self) -> frozenset[Change]:
        """All changes; empty for equal results."""
        return frozenset(_changes(self.row_a, self.row_b))


@dataclass(frozen=True, kw_only=True)
class Matching:
    """The experiments of two runs, in plan order."""

    pairs: tuple[Pair, ...]
    only_a: tuple[Experiment, ...]  # not in the other run's plan
    only_b: tuple[Experiment, ...]
    no_result_a: tuple[Experiment, ...]  # planned in both runs, but this run has no result (yet)
    no_result_b: tuple[Experiment, ...]
    ambiguous: tuple[Experiment, ...]  # in either run; another experiment of that run has the same key


def match(a: Side, b: Side) -> Matching:
    """Match experiments by id, then the remaining ones by key, unless several in one run share that key."""
    by_id = {e.id: e for e in b.experiments}
    same = {e.id for e in a.experiments if e.id in by_id}
    rest_a = [e for e in a.experiments if e.id not in same]
    rest_b = [e for e in b.experiments if e.id not in same]
    counts_a, counts_b = Counter(map(key_of, rest_a)), Counter(map(key_of, rest_b))
    by_key = {key_of(e): e for e in rest_b}
    clear = {key for key in counts_a if counts_a[key] == counts_b[key] == 1}
    partners = [
        (e, by_id[e.id] if e.id in same else by_key[key_of(e)])
        for e in a.experiments
        if e.id in same or key_of(e) in clear
    ]
    return Matching(
        pairs=tuple(
            Pair(x, y, a.rows[x.id], b.rows[y.id]) for x, y in partners if x.id in a.rows and y.id in b.rows
        ),
        only_a=tuple(e for e in rest_a if key_of(e) not in counts_b),
        only_b=tuple(e for e in rest_b if key_of(e) not in counts_a),
        no_result_a=tuple(x for x, _ in partners if x.id not in a.rows),
        no_result_b=tuple(y for _, y in partners if y.id not in b.rows),
        ambiguous=tuple(
            e
            for e in (*rest_a, *rest_b)
            if (key := key_of(e)) in counts_a and key in counts_b and key not in clear
        ),
    )


def _changes(a: Row, b: Row) -> Iterable[Change]:
    if not (a.usable and b.usable):
        if a.usable != b.usable:
            yield Change.HARNESS_ERROR if a.usable else Change.MENDED
        return
    if (a.status is Status.OK) != (b.status is Status.OK):
        yield Change.NEW_CRASH if a.status is Status.OK else Change.CRASH_GONE
    elif a.ending != b.ending:
        yield _by_harm(_harm(b) - _harm(a))
    yield from _hazard_changes(a, b)
    if a.severity != b.severity:
        yield Change.HIGHER_SEVERITY if a.severity < b.severity else Change.LOWER_SEVERITY
    if bool(a.alerts) != bool(b.alerts):
        yield Change.LOST_ALERT if a.alerts else Change.NEW_ALERT


def _by_harm(difference: int) -> Change:
    if difference:
        return Change.WORSE if difference > 0 else Change.BETTER
    return Change.OTHERWISE


def _harm(row: Row) -> int:
    return _HARM[row.outcome] if row.outcome else 0


def _hazard_changes(a: Row, b: Row) -> Iterable[Change]:
    if bool(a.hazards) != bool(b.hazards):
        yield Change.HAZARD_GONE if a.hazards else Change.NEW_HAZARD
    elif a.hazards:
        if {name for name, _ in b.hazards} - {name for name, _ in a.hazards}:
            yield Change.OTHER_HAZARD
        before, after = time_to_hazard(a), time_to_hazard(b)
        if before is not None and after is not None and before != after:
            yield Change.EARLIER_HAZARD if after < before else Change.LATER_HAZARD


def time_to_hazard(row: Row) -> float | None:
    """Time from activation to the first hazard, s; None without a hazard."""
    if not row.hazards or row.t_activation is None:
        return None
    return round(row.hazards[0][1] - row.t_activation, _TIME_DIGITS)
