"""Audit records: check that trees, patches and verdicts follow from the rest of the run."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path

from mutator._common.confined_files import path_below
from mutator._common.hashing import digest
from mutator._common.message_text import counted
from mutator.engines.engine_jobs import MODES_TO_PROVE
from mutator.errors import InvalidMutant, MutatorError
from mutator.faults.fault_models import FaultModels
from mutator.model import Fault, ObservedActivation, Record, Status, Trigger
from mutator.mutants.mutant_building import build
from mutator.outcomes.lost_observed_values import LOST_VALUE_PREFIX
from mutator.outcomes.verdict_rules import EventTimes, outcome_of
from mutator.preflight import equivalence_check
from mutator.store import plan_file
from mutator.store.checksummed_lines import read_segment
from mutator.store.records import PROOF_FOLDER, record_from_json
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import RunHead
from mutator.targets.manifest import TargetManifest

_DIGEST_DIGITS = 64  # hex digits of a SHA-256
_TIME_SLACK_S = 1e-9  # times are sums of steps, which round


@dataclass(frozen=True, slots=True)
class StoredRecord:
    path: Path
    line: int
    record: Record

    def difference_error(self, got: str, expected: str) -> MutatorError:
        name = self.record.experiment_id
        return MutatorError(f"{name}: {got}", where=self.path, line=self.line, expected=expected)


def load_stored_records(folder: RunFolder, kind: str) -> list[StoredRecord]:
    """Return the readable records of one kind, without harness errors."""
    records = []
    for path in sorted(path for path in path_below(folder.path, kind).glob("*.jsonl") if path.is_file()):
        segment = read_segment(path)
        for number in segment.lines:
            try:
                record = record_from_json(segment.parse_line(number))
            except (
                MutatorError,
                KeyError,
                TypeError,
                ValueError,
            ):  # a head, or damage that is reported elsewhere
                continue
            if record.status is not Status.HARNESS_ERROR:
                records.append(StoredRecord(path, number, record))
    return records


def mutant_problems(
    folder: RunFolder, records: Sequence[StoredRecord], manifest: TargetManifest, models: FaultModels
) -> Iterator[MutatorError]:
    """Rebuild the mutants. Yield an error for each record with another tree or patch, and for each stored
    patch that differs, is missing, or belongs to no experiment.
    """
    experiments = {experiment.id: experiment for experiment in plan_file.load_experiments(folder.path)}
    built: dict[tuple[str, Trigger], tuple[str, str]] = {}
    for recorded in records:
        experiment = experiments.get(recorded.record.experiment_id)
        if experiment is None or recorded.record.status is Status.LEFT_OUT:  # it has no mutant
            continue
        key = (experiment.fault.id, experiment.trigger)
        if key not in built:
            built[key] = _rebuilt_tree_and_patch_digests(
                manifest, models, experiment.fault, experiment.trigger
            )
        tree, patch = built[key]
        if recorded.record.tree != tree:
            yield recorded.difference_error(
                f"tree {recorded.record.tree[:16] or 'none'}", tree[:16] or "none"
            )
        if recorded.record.patch != patch:
            yield recorded.difference_error(
                f"patch {recorded.record.patch[:16] or 'none'}", patch[:16] or "none"
            )
        stored_patch = folder.patches.read_patch(recorded.record.experiment_id)
        stored_digest = "" if stored_patch is None else digest(stored_patch)
        if stored_digest != patch:
            name = recorded.record.experiment_id
            got = (
                f"a patch of {name} with SHA-256 {stored_digest[:16]}"
                if stored_digest
                else f"no patch of {name}"
            )
            where = folder.patches.expected_file_of(recorded.record.experiment_id)
            none = "no patch, because the mutant cannot be built"
            expected = f"the mutant's patch, {patch[:16]}" if patch else none
            yield MutatorError(got, where=where, expected=expected)
    recorded_ids = {stored_record.record.experiment_id for stored_record in records}
    for name in folder.patches if folder.is_finished else ():
        if name not in recorded_ids:
            got, where = (
                f"a patch of {name}, which is not an experiment of this run",
                folder.patches.expected_file_of(name),
            )
            yield MutatorError(got, where=where, expected="patches only of experiments that ran")


def _rebuilt_tree_and_patch_digests(
    manifest: TargetManifest, models: FaultModels, fault: Fault, trigger: Trigger
) -> tuple[str, str]:
    """Digests of a mutant's tree and patch; empty if it cannot be built."""
    try:
        mutant = build(manifest, models, fault, trigger)
    except InvalidMutant:
        return "", ""
    return mutant.tree_digest, digest(mutant.patch_bytes)


def verdict_problems(
    head: RunHead, records: Sequence[StoredRecord], manifest: TargetManifest | None
) -> Iterator[MutatorError]:
    """Yield an error for each field that contradicts another field, run.json or the manifest."""
    tolerances = (
        {channel.name: channel.tolerance for channel in manifest.compared_channels} if manifest else {}
    )
    for stored in records:
        flaws = (
            _verdict_contradictions(stored.record)
            if stored.record.status is Status.OK
            else _failed_run_contradictions(stored.record)
        )
        flaws_of_names = _target_contradictions(stored.record, head, tolerances)
        for got, expected in (*flaws, *flaws_of_names, *_departure_contradictions(stored.record, head)):
            yield stored.difference_error(got, expected)


_Contradictions = Iterator[tuple[str, str]]  # found, expected


def _verdict_contradictions(record: Record) -> _Contradictions:
    activation = record.activation
    expected = outcome_of(
        activation=activation,
        t_manifest=record.t_manifest,
        hazards=record.hazards,
        against_golden=record.against_golden,
    )
    if record.outcome != expected:
        yield f"outcome {record.outcome}", f"{expected}, which follows from the recorded times"
    if record.t_manifest is not None and (activation is None or record.t_manifest < activation.first):
        yield f"manifested at {record.t_manifest} s", "a time at or after the activation"
    for what, events in (("hazards", record.hazards), ("alerts", record.alerts)):
        if not _is_in_order(events, activation):
            yield f"{what} {events}", "each once, in order, at or after the activation"
    if activation and not (activation.first <= activation.last and activation.count > 0):
        got = f"active {counted(activation.count, 'time')}, from {activation.first} s to {activation.last} s"
        yield got, "at least one activation, the first not after the last"
    if record.golden_hazards and record.against_golden is None:
        yield f"hazards of golden {record.golden_hazards}", "how they compare with those of the golden run"
    if len(record.trace_digest) != _DIGEST_DIGITS:
        yield f"trace digest '{record.trace_digest}'", "that of the recorded trace"


def _failed_run_contradictions(record: Record) -> _Contradictions:
    values = {
        "outcome": record.outcome,
        "t_manifest": record.t_manifest,
        "max_dev": record.max_dev,
        "dev": record.dev,
        "t_end": None if record.detail.startswith(LOST_VALUE_PREFIX) else record.t_end,
        "metrics": record.metrics,
        "left": record.left,
        "hazards": record.hazards,
        "against_golden": record.against_golden,
        "golden_hazards": record.golden_hazards,
        "alerts": record.alerts,
        "trace_digest": record.trace_digest,
    }
    for name, value in values.items():
        if value:
            yield f"{name} {value}", f"none, because the experiment ended as {record.status.value}"


def _target_contradictions(record: Record, head: RunHead, tolerances: Mapping[str, float]) -> _Contradictions:
    """Hazards or channels that the target does not have, and differences beyond the tolerance without a
    manifestation.
    """
    unknown = [name for name, _ in (*record.hazards, *record.golden_hazards) if name not in head.hazards]
    if unknown:
        yield f"hazard {unknown[0]}", f"one of {', '.join(head.hazards)}"
    channels = [name for name, _ in record.max_dev]
    if record.status is Status.OK and channels != list(head.compared):
        yield f"differences of {', '.join(channels)}", f"those of {', '.join(head.compared)}"
    beyond = [name for name, value in record.max_dev if value > tolerances.get(name, float("inf"))]
    largest = dict(record.max_dev)
    if any(value > largest.get(name, -1.0) for name, value in record.dev):
        yield f"differences {record.dev} up to the drive's end", f"none larger than {record.max_dev}"
    if beyond and record.t_manifest is None:
        yield f"{beyond[0]} differs, but no manifestation is recorded", "the time of the first difference"


def _departure_contradictions(record: Record, head: RunHead) -> _Contradictions:
    """Channels that the target does not have, times after the end of the drive, and a manifestation time that
    is not the first time at which an actuator differs from the golden run.
    """
    end = inf if record.t_end is None else record.t_end + _TIME_SLACK_S
    channel_names = [channel.name for channel in head.channels]
    for name, first, _ in record.left:
        if name not in channel_names:
            yield f"channel {name} left golden", f"one of {', '.join(channel_names)}"
        elif first > end:
            yield (
                f"{name} left golden at {first} s",
                f"a time up to the end of the drive, {record.t_end} s",
            )
    times = [first for name, first, _ in record.left if name in head.compared]
    manifested = record.t_manifest if record.t_manifest is not None and record.t_manifest <= end else None
    if record.status is Status.OK and min(times, default=None) != manifested:
        when = f"first at {manifested} s" if manifested is not None else "at no time"
        yield f"actuators left golden at {times or 'no time'}", f"{when}, as recorded"


def _is_in_order(events: EventTimes, activation: ObservedActivation | None) -> bool:
    if activation is None:
        return not events
    times = [time for _, time in events]
    once = len({name for name, _ in events}) == len(events)
    return once and times == sorted(times) and all(time >= activation.first for time in times)


def proof_problems(
    folder: RunFolder, records: Sequence[StoredRecord], proven: Sequence[StoredRecord]
) -> Iterator[MutatorError]:
    """Yield records of the proof that differ from those of the run or are not in the sample, and experiments
    of the sample that have no record.
    """
    proof_folder = folder.path / PROOF_FOLDER
    if not proof_folder.is_dir():
        modes = {str(line["engine"]) for line in folder.timings().values()}
        if forked := sorted(modes & MODES_TO_PROVE):
            yield MutatorError("missing", where=proof_folder, expected=f"a proof of the engine `{forked[0]}`")
        return
    record_by_id = {stored.record.experiment_id: stored.record for stored in records}
    sampled = set(equivalence_check.sample_ids_in_folder(folder))
    proven_ids = {stored.record.experiment_id for stored in proven}
    # earlier, all experiments of a small plan were proved, which is more than its sample
    is_small = folder.head.experiments < equivalence_check.SMALL_PLAN_SIZE
    is_all_proven = is_small and proven_ids >= folder.planned_positions().keys()
    for proven_record in proven:
        record = record_by_id.get(proven_record.record.experiment_id)
        if record is not None and record != proven_record.record:
            yield proven_record.difference_error(
                equivalence_check.describe_difference(proven_record.record, record), "what the run recorded"
            )
        if proven_record.record.experiment_id not in sampled and not is_all_proven:
            yield proven_record.difference_error(
                "in the proof", "only experiments of the sample that the plan determines"
            )
    missing = sorted(sampled - proven_ids)
    if folder.is_finished and missing:
        yield MutatorError(
            f"no record of {missing[0]}", where=proof_folder, expected="a record of each sampled experiment"
        )
