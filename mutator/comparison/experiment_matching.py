"""Matches the experiments of two runs and classifies the changes in each pair."""

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

from mutator.comparison.compared_runs import ComparedRun, experiment_key
from mutator.model import Experiment, GoldenClass, Outcome, Status
from mutator.results.result_rows import ResultRow

# a fault that never ran did as little harm as one that was masked
_HARM_RANK_BY_OUTCOME = {Outcome.NOT_ACTIVATED: 0, Outcome.MASKED: 0, Outcome.SDC: 1, Outcome.HAZARD: 2}
_TIME_DECIMALS = 6  # decimals of a time from activation; absorbs rounding errors


class ResultChangeKind(StrEnum):
    """A change in the second run of a pair, relative to the first. `run_comparison_and_gates.Gate` explains
    the changes for the worse.
    """

    GOLDEN_HAZARD = "golden-hazard"
    NEW_SILENT_HAZARD = "new-silent-hazard"
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
    GOLDEN_HAZARD_GONE = "golden-hazard-gone"
    HARNESS_ERROR_GONE = "mended"  # a result, although the first run has none
    OTHER_HARMLESS_OUTCOME = (
        "otherwise"  # another outcome that is neither better nor worse: masked or not activated
    )


@dataclass(frozen=True)
class ExperimentPair:
    """One experiment in both runs, with its rows."""

    a: Experiment
    b: Experiment
    row_a: ResultRow
    row_b: ResultRow

    @property
    def is_usable(self) -> bool:
        """Whether both runs have a valid result for the fault."""
        return self.row_a.usable and self.row_b.usable

    @cached_property
    def change_kinds(self) -> frozenset[ResultChangeKind]:
        """All changes; empty for equal results."""
        return frozenset(_change_kinds_between(self.row_a, self.row_b))


@dataclass(frozen=True, kw_only=True)
class ExperimentMatching:
    """The experiments of two runs, in plan order."""

    pairs: tuple[ExperimentPair, ...]
    only_a: tuple[Experiment, ...]  # not in the other run's plan
    only_b: tuple[Experiment, ...]
    no_result_a: tuple[Experiment, ...]  # planned in both runs, but this run has no result (yet)
    no_result_b: tuple[Experiment, ...]
    ambiguous: tuple[Experiment, ...]  # in either run; another experiment of that run has the same key


def match_experiments(a: ComparedRun, b: ComparedRun) -> ExperimentMatching:
    """Match experiments by id, then the remaining ones by key, unless several in one run share that key."""
    by_id = {e.id: e for e in b.experiments}
    shared_ids = {e.id for e in a.experiments if e.id in by_id}
    rest_a = [e for e in a.experiments if e.id not in shared_ids]
    rest_b = [e for e in b.experiments if e.id not in shared_ids]
    counts_a, counts_b = Counter(map(experiment_key, rest_a)), Counter(map(experiment_key, rest_b))
    by_key = {experiment_key(e): e for e in rest_b}
    unambiguous = {key for key in counts_a if counts_a[key] == counts_b[key] == 1}
    partners = [
        (e, by_id[e.id] if e.id in shared_ids else by_key[experiment_key(e)])
        for e in a.experiments
        if e.id in shared_ids or experiment_key(e) in unambiguous
    ]
    return ExperimentMatching(
        pairs=tuple(
            ExperimentPair(x, y, a.row_by_id[x.id], b.row_by_id[y.id])
            for x, y in partners
            if x.id in a.row_by_id and y.id in b.row_by_id
        ),
        only_a=tuple(e for e in rest_a if experiment_key(e) not in counts_b),
        only_b=tuple(e for e in rest_b if experiment_key(e) not in counts_a),
        no_result_a=tuple(x for x, _ in partners if x.id not in a.row_by_id),
        no_result_b=tuple(y for _, y in partners if y.id not in b.row_by_id),
        ambiguous=tuple(
            e
            for e in (*rest_a, *rest_b)
            if (key := experiment_key(e)) in counts_a and key in counts_b and key not in unambiguous
        ),
    )


def _change_kinds_between(a: ResultRow, b: ResultRow) -> Iterable[ResultChangeKind]:
    if _has_golden_hazard(a) != _has_golden_hazard(b):
        is_new = _has_golden_hazard(b)
        yield ResultChangeKind.GOLDEN_HAZARD if is_new else ResultChangeKind.GOLDEN_HAZARD_GONE
    if not (a.usable and b.usable):
        if a.usable != b.usable:
            yield ResultChangeKind.HARNESS_ERROR if a.usable else ResultChangeKind.HARNESS_ERROR_GONE
        return
    if (a.status is Status.OK) != (b.status is Status.OK):
        yield ResultChangeKind.NEW_CRASH if a.status is Status.OK else ResultChangeKind.CRASH_GONE
    elif a.ending != b.ending:
        yield _change_kind_by_harm(_harm_rank(b) - _harm_rank(a))
    yield from _hazard_change_kinds(a, b)
    if a.severity != b.severity:
        yield ResultChangeKind.HIGHER_SEVERITY if a.severity < b.severity else ResultChangeKind.LOWER_SEVERITY
    yield from _alert_change_kinds(a, b)


def _has_golden_hazard(row: ResultRow) -> bool:
    return row.golden_class == GoldenClass.HAZARD_WITHOUT_FAULT


def _alert_change_kinds(a: ResultRow, b: ResultRow) -> Iterable[ResultChangeKind]:
    if silent_hazards(b) - silent_hazards(a):
        yield ResultChangeKind.NEW_SILENT_HAZARD
    if b.alerts and not a.alerts:
        yield ResultChangeKind.NEW_ALERT
    # a hazard that is gone needs no alert
    if a.alerts and not b.alerts and (b.hazards or not a.hazards):
        yield ResultChangeKind.LOST_ALERT


def silent_hazards(row: ResultRow) -> frozenset[str]:
    """Return the names of the hazards in the drive that no alert came before."""
    silent_until = math.inf if row.t_alert is None else row.t_alert
    drive_end = math.inf if row.t_end is None else row.t_end
    return frozenset(name for name, time in row.hazards if time <= min(silent_until, drive_end))


def _change_kind_by_harm(harm_increase: int) -> ResultChangeKind:
    if harm_increase:
        return ResultChangeKind.WORSE if harm_increase > 0 else ResultChangeKind.BETTER
    return ResultChangeKind.OTHER_HARMLESS_OUTCOME


def _harm_rank(row: ResultRow) -> int:
    return _HARM_RANK_BY_OUTCOME[row.outcome] if row.outcome else 0


def _hazard_change_kinds(a: ResultRow, b: ResultRow) -> Iterable[ResultChangeKind]:
    if bool(a.hazards) != bool(b.hazards):
        yield ResultChangeKind.HAZARD_GONE if a.hazards else ResultChangeKind.NEW_HAZARD
    elif a.hazards:
        if {name for name, _ in b.hazards} - {name for name, _ in a.hazards}:
            yield ResultChangeKind.OTHER_HAZARD
        before, after = time_to_hazard(a), time_to_hazard(b)
        if before is not None and after is not None and before != after:
            yield ResultChangeKind.EARLIER_HAZARD if after < before else ResultChangeKind.LATER_HAZARD


def time_to_hazard(row: ResultRow) -> float | None:
    """Time from activation to the first hazard, s; None without a hazard."""
    if not row.hazards or row.t_activation is None:
        return None
    return round(row.hazards[0][1] - row.t_activation, _TIME_DECIMALS)
