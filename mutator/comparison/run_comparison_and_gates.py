"""A comparison of two runs: tables, remarks and gate findings."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import Any

from mutator._common.phrase_texts import measured_number_text
from mutator.comparison.compared_runs import ComparedRun, load_compared_run
from mutator.comparison.envelope_changes import (
    EnvelopeChange,
    EnvelopesOfEachRun,
    compare_envelopes,
    envelopes_sheet,
    planes_only_in,
    remarks_on_planes,
)
from mutator.comparison.experiment_matching import (
    ExperimentMatching,
    ExperimentPair,
    ResultChangeKind,
    match_experiments,
    time_to_hazard,
)
from mutator.comparison.input_differences_and_remarks import (
    DifferingTargetFiles,
    InputFact,
    campaign_parts_remark,
    different_campaigns_remark,
    differing_pairs_remarks,
    differing_target_files,
    input_facts,
    severity_remarks,
)
from mutator.comparison.metric_and_severity_sheets import metrics_sheets, severity_cross_table
from mutator.comparison.paired_rate_and_time_sheets import (
    RunDisplayNames,
    change_counts_sheet,
    endings_cross_table,
    rates_sheets,
    times_sheets,
    usable_pair_events,
)
from mutator.errors import MutatorError
from mutator.explore.envelope_texts import name_of_plane
from mutator.explore.exploration_replay import is_exploration
from mutator.model import Experiment
from mutator.results.result_rows import ResultRow
from mutator.statistics.statistics_sheet import Sheet

SceneOfEachRun = tuple[dict[str, Any] | None, dict[str, Any] | None]


class Gate(StrEnum):
    """What a gate fails on: a change for the worse, or an unmatched experiment."""

    #: the second run's golden run has a hazard without any fault, although the first run's has none
    GOLDEN_HAZARD = ResultChangeKind.GOLDEN_HAZARD.value
    NEW_HAZARD = ResultChangeKind.NEW_HAZARD.value  #: a hazard, although the first run has none
    #: a hazard without an alert before it, although the first run has no such hazard, or an alert before it
    NEW_SILENT_HAZARD = ResultChangeKind.NEW_SILENT_HAZARD.value
    #: another hazard, although the first run already has one
    OTHER_HAZARD = ResultChangeKind.OTHER_HAZARD.value
    HIGHER_SEVERITY = (
        ResultChangeKind.HIGHER_SEVERITY.value
    )  #: a hazard of a higher class, or one with a class although the first run has none
    EARLIER_HAZARD = ResultChangeKind.EARLIER_HAZARD.value  #: less time from activation to the first hazard
    #: no alert, although the first run has one; a hazard of the first run, if any, is not gone
    LOST_ALERT = ResultChangeKind.LOST_ALERT.value
    WORSE = (
        ResultChangeKind.WORSE.value
    )  #: a worse outcome, in the order no effect, sdc, hazard; includes a new hazard
    NEW_CRASH = ResultChangeKind.NEW_CRASH.value  #: the controller crashes or does not finish
    HARNESS_ERROR = (
        ResultChangeKind.HARNESS_ERROR.value
    )  #: the second run has no result, although the first has one
    #: an exploration's cell without hazard is now hazardous, or not decided, for its runs have no result
    SMALLER_ENVELOPE = "smaller-envelope"
    UNMATCHED = "unmatched"  #: an experiment that only one of the runs has
    SEVERITY_S0 = "severity:S0"  #: a hazard of class S0 or worse; in the first run a milder one or none
    SEVERITY_S1 = "severity:S1"  #: a hazard of class S1 or worse; in the first run a milder one or none
    SEVERITY_S2 = "severity:S2"  #: a hazard of class S2 or worse; in the first run a milder one or none
    SEVERITY_S3 = "severity:S3"  #: a hazard of class S3; in the first run a milder one or none


@dataclass(frozen=True, slots=True, kw_only=True)
class GateFinding:
    """An experiment on which a gate fails, and why. If both runs have it, the id is the second run's."""

    gate: Gate
    experiment_id: str
    description: str
    sentence: str = ""  # about the second run


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Two matched runs. `golden_alerts_notes` has a note on the alerts of each run's golden runs, or '';
    `scenes` has what the page's replays of each run draw, as JSON, or None; `envelopes` those of each run
    that is an exploration.
    """

    a: ComparedRun
    b: ComparedRun
    matching: ExperimentMatching
    golden_alerts_notes: tuple[str, str] = ("", "")
    scenes: SceneOfEachRun = (None, None)
    envelopes: EnvelopesOfEachRun = ((), ())

    @cached_property
    def envelope_changes(self) -> tuple[EnvelopeChange, ...]:
        """The planes that both runs have explored."""
        return compare_envelopes(self.envelopes)

    @cached_property
    def names(self) -> RunDisplayNames:
        """The display names of the runs, made distinct if they are equal."""
        a, b = self.a.name, self.b.name
        return RunDisplayNames(a=a, b=b) if a != b else RunDisplayNames(a=f"A: {a}", b=f"B: {b}")

    @property
    def pairs(self) -> tuple[ExperimentPair, ...]:
        return self.matching.pairs

    @cached_property
    def changed_pairs(self) -> tuple[ExperimentPair, ...]:
        """Pairs with any change: new hazards first, then in the order of `ResultChangeKind` and the plan."""
        order = list(ResultChangeKind)
        changed = (pair for pair in self.pairs if pair.change_kinds)
        return tuple(sorted(changed, key=lambda pair: sorted(map(order.index, pair.change_kinds))))

    def pairs_with_change(self, change: ResultChangeKind) -> tuple[ExperimentPair, ...]:
        return tuple(p for p in self.pairs if change in p.change_kinds)

    @cached_property
    def facts(self) -> tuple[InputFact, ...]:
        return input_facts(self.a, self.b)

    @cached_property
    def differing_target_files(self) -> DifferingTargetFiles:
        return differing_target_files(self.a.folder, self.b.folder)

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """Caveats to read before the tables."""
        noted = zip((self.names.a, self.names.b), self.golden_alerts_notes, strict=True)
        alert_remarks = tuple(f"{name}: {note}" for name, note in noted if note)
        return (
            self.campaign_remarks
            + differing_pairs_remarks(self.a, self.b, self.matching)
            + severity_remarks(self.a, self.b)
            + alert_remarks
            + tuple(remarks_on_planes(self.envelopes, self.names))
        )

    @cached_property
    def campaign_remarks(self) -> tuple[str, ...]:
        """Remarks that the runs cover different campaigns, or different parts of one; the first to read."""
        remarks = (different_campaigns_remark(self.a, self.b), campaign_parts_remark(self.a, self.b))
        return tuple(filter(None, remarks))

    @cached_property
    def sheets(self) -> tuple[Sheet, ...]:
        """The tables, most important first. What an exploration chose to run has no rates."""
        frame = usable_pair_events(self.pairs, self.a.stratum_by_id)
        is_explored = any(is_exploration(run.folder) for run in (self.a, self.b))
        rates = () if is_explored else rates_sheets(frame, self.names)
        spans, spans_by_type = times_sheets(frame, self.names)
        counts = (endings_cross_table(self.pairs, self.names), change_counts_sheet(self.pairs))
        metrics, metrics_by_type = metrics_sheets(self.pairs, self.a, self.b, self.names)
        severity = severity_cross_table(self.pairs, self.names, self.b.folder.severity_scale)
        explored = self.envelope_changes
        return (
            *([envelopes_sheet(explored, self.names)] if explored else []),
            *(*counts, *rates[:1], spans),
            *(sheet for sheet in (severity, metrics) if sheet.lines),
            *(*rates[1:], spans_by_type, *([metrics_by_type] if metrics.lines else [])),
        )

    @cached_property
    def unmatched_experiments(self) -> tuple[tuple[str, Experiment], ...]:
        """The experiments that could not be compared, with reasons."""
        m, names = self.matching, self.names
        groups: tuple[tuple[str, Sequence[Experiment]], ...] = (
            (f"only in {names.a}", m.only_a),
            (f"only in {names.b}", m.only_b),
            (f"without a result in {names.a}", m.no_result_a),
            (f"without a result in {names.b}", m.no_result_b),
            ("with the same fault, scenario and trigger as another experiment of their run", m.ambiguous),
        )
        return tuple((why, experiment) for why, group in groups for experiment in group)

    @property
    def missing_result_count(self) -> int:
        """The number of missing results among experiments that both runs planned."""
        m = self.matching
        return (
            len(m.no_result_a)
            + len(m.no_result_b)
            + sum(not row.usable for pair in self.pairs for row in (pair.row_a, pair.row_b))
        )


def compare_runs(
    run_a: Path,
    run_b: Path,
    only: str | None = None,
    golden_alerts_notes: tuple[str, str] = ("", ""),
    scenes: SceneOfEachRun = (None, None),
    envelopes: EnvelopesOfEachRun = ((), ()),
) -> Comparison:
    """Compare two run folders; `only` filters experiments by plan columns.

    Raise MutatorError if no experiment has a partner, and CheckFailed if a run's equivalence check failed.
    """
    a, b = load_compared_run(run_a, only), load_compared_run(run_b, only)
    return compare_loaded_runs(a, b, golden_alerts_notes, scenes, envelopes)


def compare_loaded_runs(
    a: ComparedRun,
    b: ComparedRun,
    golden_alerts_notes: tuple[str, str] = ("", ""),
    scenes: SceneOfEachRun = (None, None),
    envelopes: EnvelopesOfEachRun = ((), ()),
) -> Comparison:
    """Like `compare_runs`, for runs that are in memory."""
    # classify both runs by the same scale, or neither, and by metrics that both have
    scale = b.folder.severity_scale if a.folder.severity_scale else None
    if scale:
        scale = scale.with_only_rules_of_metrics([metric.name for metric in a.folder.head.metrics])
    a, b = a.classified_by(scale), b.classified_by(scale)
    matching = match_experiments(a, b)
    if not matching.pairs:
        campaigns = dict.fromkeys((a.folder.head.campaign, b.folder.head.campaign))
        raise MutatorError(
            f"no experiment of {a.name} has a partner in {b.name} (campaign {' and '.join(campaigns)}; "
            f"experiments with a result: {len(a.row_by_id)} and {len(b.row_by_id)})",
            where=b.folder.path,
            argument="only",
            expected="runs of the same faults, scenarios and triggers",
            remedy="compare runs of one campaign, or widen `only`",
        )
    return Comparison(
        a=a,
        b=b,
        matching=matching,
        golden_alerts_notes=golden_alerts_notes,
        scenes=scenes,
        envelopes=envelopes,
    )


def findings_of_gates(comparison: Comparison, gates: Sequence[Gate]) -> tuple[GateFinding, ...]:
    gate_findings: list[GateFinding] = []
    for gate in gates:
        if gate is Gate.UNMATCHED:
            m = comparison.matching
            unmatched = (*m.only_a, *m.only_b, *m.ambiguous)
            gate_findings += [
                GateFinding(gate=gate, experiment_id=e.id, description=e.label) for e in unmatched
            ]
            continue
        if gate is Gate.SMALLER_ENVELOPE:
            gate_findings += _smaller_envelopes(comparison)
            continue
        _, is_severity, least = gate.value.partition(":")
        pairs = (
            _pairs_reaching_class(comparison, least)
            if is_severity
            else comparison.pairs_with_change(ResultChangeKind(gate.value))
        )
        gate_findings += [
            GateFinding(
                gate=gate,
                experiment_id=p.b.id,
                description=f"{p.b.label}: {describe_ending_change(p)}",
                sentence=p.row_b.sentence,
            )
            for p in pairs
        ]
    return tuple(gate_findings)


def _smaller_envelopes(comparison: Comparison) -> Iterator[GateFinding]:
    changes = comparison.envelope_changes
    if mismatch := next((change.mismatch for change in changes if change.mismatch), ""):
        raise MutatorError(
            mismatch,
            where=comparison.b.folder.path,
            argument="fail_on",
            expected=f"magnitudes, durations, starts and observe_s of {comparison.a.name}",
            remedy="explore both versions with the same `mutator envelope`, or omit the gate",
        )
    # where every run has a result, what is not decided was not driven
    undecided = [c.b for c in changes if not c.is_smaller and (c.became_undecided or not c.decided)]
    undecided += [envelope for c in changes for envelope in (c.a, c.b) if not envelope.was_active]
    missing = [*planes_only_in(*comparison.envelopes), *undecided]
    if missing or not changes:
        raise MutatorError(
            f"{name_of_plane(missing[0])} is not decided" if missing else "no exploration",
            where=comparison.b.folder.path,
            argument="fail_on",
            expected=f"what {comparison.a.name} has explored, and the library of both runs",
            remedy="finish it with the same `mutator envelope`, or omit the gate",
        )
    compared = {experiment.id for experiment in comparison.b.experiments}  # `only` leaves some out
    for change in changes:
        if change.evidence and change.evidence.experiment_id in compared:
            yield GateFinding(
                gate=Gate.SMALLER_ENVELOPE,
                experiment_id=change.evidence.experiment_id,
                description=change.text,
            )


def _pairs_reaching_class(comparison: Comparison, least: str) -> tuple[ExperimentPair, ...]:
    """Return the pairs that reach the severity class `least` in the second run but not in the first."""
    for side in (comparison.a, comparison.b):
        if side.folder.severity_scale is None:
            raise MutatorError(
                f"{side.name} has no severity classes",
                where=side.folder.path,
                argument="fail_on",
                expected="two runs planned with a manifest that has `severity`",
                remedy="omit the severity gate, or rerun the campaign",
            )
    return tuple(p for p in comparison.pairs if p.is_usable and p.row_a.severity < least <= p.row_b.severity)


def describe_ending_change(pair: ExperimentPair) -> str:
    """How a pair's outcome changed, for example `sdc -> hazard (NEAR 7.10 s after activation)`."""
    return f"{_describe_ending(pair.row_a)} -> {_describe_ending(pair.row_b)}"


def _describe_ending(row: ResultRow) -> str:
    time = time_to_hazard(row)
    details = []
    if row.hazards:
        names = ", ".join(name for name, _ in row.hazards)
        details.append(names if time is None else f"{names} {time:.2f} s after activation")
    if row.severity:
        details.append(row.severity_label)
        if row.delta_v is not None:
            details[-1] += f", delta-v {measured_number_text(row.delta_v, 'm/s')}"
    if row.alerts:
        is_late = bool(row.hazards) and row.reaction_time is None
        details.append(f"alert {', '.join(row.alerts)}" + (" only after the hazard" if is_late else ""))
    if not row.usable or (row.detail and not details):
        details.append(row.detail.splitlines()[0] if row.detail else "no result")
    return f"{row.ending} ({'; '.join(details)})" if details else row.ending
