"""The equivalence check: rerun a sample of a campaign's experiments on the reference engine.

Every record of the sample must be the same, including the trace digest. The check's runs use nothing from
other runs (`entry.independent` of the manifest), so the check also covers data that other runs share. Its
records are in the run's folder `proof/`, which is removed if no experiment was forked.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby
from math import comb
from pathlib import Path

from mutator._common.files import raising_disk_full, remove_folder
from mutator._common.hashing import digest
from mutator._common.message_text import counted
from mutator.campaigns.sampling import draw_balanced
from mutator.engines.engine_jobs import RunMode
from mutator.errors import CheckFailed
from mutator.model import Experiment, Record, Status
from mutator.store import file_digests, plan_file
from mutator.store.records import PROOF_FOLDER, endings_of
from mutator.store.run_folder import RunFolder

_MIN_SAMPLE = 20  # finds an engine that changes one record in seven with a chance of 95%
SMALL_PLAN_SIZE = 40  # with fewer experiments, 20 would be most of them
_MIN_SMALL_SAMPLE, _EXPERIMENTS_PER_SAMPLED_IN_SMALL_PLAN = 3, 10
_CONFIDENCE = 0.95  # with which a sample finds what its note says
_PROOF_ERROR_PREFIX = "in the proof: "
_EXPERIMENTS_PER_SAMPLED_EXPERIMENT = 100  # one experiment in this many
# Of a bench, which can end after few experiments: a tenth of the first ones.
_EARLY_RATE, _EARLY_EXPERIMENTS, _LEAST_CHOSEN = 10, 200, 3


@dataclass(frozen=True, slots=True)
class SampledExperiment:
    """An experiment of the sample that has not run yet."""

    number: int
    id: str


@dataclass(frozen=True, slots=True, kw_only=True)
class EquivalenceResult:
    """The state of a run's equivalence check: the number of experiments in the sample, the number with the
    same result, and the harness errors of the check's own runs (experiment id, detail).
    """

    sampled: int
    same: int
    errors: tuple[tuple[str, str], ...] = ()
    chosen: int = 0  # experiments of a bench that were chosen, not drawn: no part of a share
    same_chosen: int = 0
    note: str = ""  # of a small sample: what it can exclude, and what it does not cover

    @property
    def is_complete(self) -> bool:
        return self.same == self.sampled and self.same_chosen == self.chosen

    def __str__(self) -> str:
        return "; ".join(filter(None, (self.without_note, self.note if self.is_complete else "")))

    @property
    def without_note(self) -> str:
        """The state of the check, without what a small sample can exclude."""
        if not self.chosen:
            return self._describe_sample()
        # the rules of `sample_of_bench`: each chosen experiment follows one of them
        chosen = (
            f"{self.same_chosen} of {self.chosen} chosen among the first {_LEAST_CHOSEN} or as the first of "
            "their fault type or scenario"
        )
        if not self.sampled:
            return f"{chosen} came out the same on the reference engine; no experiment was drawn"
        return f"{self._describe_sample()}; besides, {chosen}"

    def _describe_sample(self) -> str:
        if not self.sampled:
            return "no experiment of this part is in the sample"
        sampled = counted(self.sampled, "experiment")
        drawn = f"{sampled} that were drawn" if self.chosen else sampled
        same = f"{self.same} of {drawn} came out the same on the reference engine"
        if self.same == self.sampled:
            return same
        # a difference raises CheckFailed, so the others have no result
        others = f"{same}; the others" if self.same else f"none of {sampled}"
        return f"{others} could {'not ' if self.same else ''}be judged: {self._reason_not_judged()}"

    def _reason_not_judged(self) -> str:
        if not self.errors:
            return "they have no result yet"
        first_detail = self.errors[0][1].removeprefix(_PROOF_ERROR_PREFIX)
        return f"{counted(len(self.errors), 'harness error')} ({first_detail})"


def mark_check_as_needed(run: Path) -> None:
    """Record that the run has results that need an equivalence check."""
    with raising_disk_full(run):
        (run / PROOF_FOLDER).mkdir(exist_ok=True)


def choose_sample(experiments: Sequence[Experiment], seed: int) -> tuple[Experiment, ...]:
    """Choose one experiment in a hundred, at least 20, with every fault type, and every scenario or
    family.

    Of fewer than 40 experiments, draw one in ten, at least three: 20 would be most of them. Each is equally
    likely, so that the sample can say what it excludes.
    """
    if len(experiments) < SMALL_PLAN_SIZE:
        count = max(_MIN_SMALL_SAMPLE, -(-len(experiments) // _EXPERIMENTS_PER_SAMPLED_IN_SMALL_PLAN))
        drawn_ids = {e.id for e in sorted(experiments, key=lambda e: digest([seed, e.id]))[:count]}
        return tuple(experiment for experiment in experiments if experiment.id in drawn_ids)
    count = max(_MIN_SAMPLE, -(-len(experiments) // _EXPERIMENTS_PER_SAMPLED_EXPERIMENT))
    chosen = list(draw_balanced(experiments, count, seed))
    covered = {mark for experiment in chosen for mark in _traits_to_cover(experiment)}
    for experiment in sorted(experiments, key=lambda e: digest([seed, e.id])):
        if not covered.issuperset(_traits_to_cover(experiment)):
            chosen.append(experiment)
            covered.update(_traits_to_cover(experiment))
    return tuple(chosen)


def _sample_ids_of_plan(folder: RunFolder) -> set[str]:
    """Ids of a plan's sample. For several seeds, each seed after the first adds one experiment in a
    hundred. Experiments that are left out are not in it; instead of them, others are.

    Before the checks have passed, nobody knows which these are. What was in the sample by then stays in it,
    because it may have been proved.
    """
    left_out = folder.left_out_goldens
    if folder.is_bench:
        sample = _cached_bench_sample(folder.path, folder.head.plan, left_out)
        return {*sample.drawn, *sample.chosen}
    ids = set(_cached_sample_ids(folder.path, folder.head.plan, len(folder.seeds), frozenset()))
    if left_out:
        ids &= {experiment.id for experiment in _experiments_to_run(folder, left_out)}
        ids.update(_cached_sample_ids(folder.path, folder.head.plan, len(folder.seeds), left_out))
    return ids


def _experiments_to_run(folder: RunFolder, left_out_goldens: Collection[str]) -> list[Experiment]:
    return [
        experiment
        for experiment in plan_file.iterate_experiments(folder.path)
        if folder.golden_run_of(experiment).key not in left_out_goldens
    ]


@dataclass(frozen=True, slots=True)
class BenchSample:
    """The ids of a bench's sample: drawn ones, and those chosen as the first of their kind."""

    drawn: frozenset[str]
    chosen: frozenset[str]


def sample_of_bench(experiments: Iterable[Experiment], seed: int) -> BenchSample:
    """Return the sample of a bench. Whoever is in it stays in it when the bench grows.

    A hash of seed and id draws one in ten of the first 200 experiments, and one in a hundred of the others.
    The first three are chosen, and the first of each fault type, and of each scenario or family.
    """
    drawn, chosen, covered = set[str](), set[str](), set[tuple[str, ...]]()
    for position, experiment in enumerate(experiments):
        traits = set(_traits_to_cover(experiment))
        rate = _EARLY_RATE if position < _EARLY_EXPERIMENTS else _EXPERIMENTS_PER_SAMPLED_EXPERIMENT
        if int(digest([seed, experiment.id])[:16], 16) % rate == 0:
            drawn.add(experiment.id)
        elif position < _LEAST_CHOSEN or not traits <= covered:
            chosen.add(experiment.id)
        covered |= traits
    return BenchSample(frozenset(drawn), frozenset(chosen))


@lru_cache(maxsize=4)
def _cached_bench_sample(run: Path, plan: str, left_out_goldens: frozenset[str]) -> BenchSample:
    folder = RunFolder.open_unverified(run)
    return sample_of_bench(_experiments_to_run(folder, left_out_goldens), folder.head.seed)


@lru_cache(maxsize=4)  # a session asks several times
def _cached_sample_ids(
    run: Path, plan: str, seed_count: int, left_out_goldens: frozenset[str]
) -> tuple[str, ...]:
    folder = RunFolder.open_unverified(run)
    to_run = _experiments_to_run(folder, left_out_goldens)
    if seed_count == 1 or len(to_run) < SMALL_PLAN_SIZE:
        return tuple(e.id for e in choose_sample(to_run, folder.head.seed))
    ids: list[str] = []
    for seed, group in groupby(to_run, key=lambda experiment: experiment.seed):
        experiments = tuple(group)
        sampled_experiments = (
            draw_balanced(experiments, -(-len(experiments) // _EXPERIMENTS_PER_SAMPLED_EXPERIMENT), seed)
            if ids
            else choose_sample(experiments, seed)
        )
        ids += [experiment.id for experiment in sampled_experiments]
    return tuple(ids)


def _traits_to_cover(experiment: Experiment) -> Iterator[tuple[str, ...]]:
    yield (experiment.fault.module, experiment.fault.fault_type)
    yield (experiment.family_or_scenario,)


def reason_check_not_needed(folder: RunFolder) -> str | None:
    """Return the most frequent reason why no experiment was forked; None if one was forked or still can be.

    Always None for a shard, because merged shards must all have a proof or none.
    """
    if folder.shard is not None:
        return None
    timings = folder.timings()
    finished_ids = {ending.experiment_id for ending in endings_of(folder.records()) if ending.is_final}
    reasons = Counter[str]()
    for name in folder.planned_positions():
        if name not in finished_ids:  # not run yet; any timing is from an earlier session
            return None
        timing = timings.get(name, {})
        if was_forked(timing):
            return None
        reasons[str(timing.get("why", ""))] += 1
    has_run = any(timing.get("engine") for timing in timings.values())
    otherwise = "the reference engine ran them all" if has_run else "none of them ran"
    return next((why for why, _ in reasons.most_common() if why), otherwise)


def was_forked(timing: Mapping[str, object]) -> bool:
    """Whether an experiment's result needs a proof. Without a timing, nobody knows, so it does."""
    return timing.get("engine", "unknown") not in (RunMode.REFERENCE.value, None)


def remove_proof(folder: RunFolder) -> None:
    """Remove a proof that is no longer needed."""
    removed = {
        name: None for name in file_digests.list_segments(folder.path) if name.startswith(f"{PROOF_FOLDER}/")
    }
    with file_digests.announcing_rewrites(folder.path, removed):
        remove_folder(folder.path / PROOF_FOLDER)


def remaining_sampled_experiments(folder: RunFolder) -> tuple[SampledExperiment, ...]:
    """Return the part of the sample without a valid record in `proof/`; empty if no check is needed."""
    if not (folder.path / PROOF_FOLDER).is_dir():
        return ()
    records = folder.records(PROOF_FOLDER)
    ids = [
        name for name in sample_ids_in_folder(folder) if name not in records or not _is_result(records[name])
    ]
    if ids and reason_check_not_needed(folder) is not None:
        return ()
    return tuple(SampledExperiment(number, name) for number, name in enumerate(ids))


def sample_ids_in_folder(folder: RunFolder) -> list[str]:
    """Ids of the sample in this folder's share, in plan order."""
    sampled_ids = _sample_ids_of_plan(folder)
    return [name for name in folder.planned_positions() if name in sampled_ids]


def compare_sample(folder: RunFolder, records: Mapping[str, Record]) -> EquivalenceResult | None:
    """Return the state of the check; None if none is needed. CheckFailed if a record differs on the reference
    engine.
    """
    if not (folder.path / PROOF_FOLDER).is_dir():
        return None
    reference_records = folder.records(PROOF_FOLDER)
    same_ids, errors = set[str](), []
    for name, reference_record in reference_records.items():
        record = records.get(name)
        if record is None or not _is_result(record):
            continue
        if not _is_result(reference_record):
            errors.append((name, f"{_PROOF_ERROR_PREFIX}{reference_record.detail}"))
            continue
        if record != reference_record:
            raise CheckFailed(
                f"experiment {name} differs on the reference engine: "
                f"{describe_difference(record, reference_record)}",
                where=folder.path,
                expected="the same record from every engine",
                remedy="do not trust this run: rerun it with --engine reference, and report the problem",
            )
        same_ids.add(name)
    sample_ids, chosen = set(sample_ids_in_folder(folder)), frozenset[str]()
    same_ids &= sample_ids
    if folder.is_bench:
        chosen = _cached_bench_sample(folder.path, folder.head.plan, folder.left_out_goldens).chosen
    same_chosen = len(chosen & same_ids)
    return EquivalenceResult(
        sampled=len(sample_ids) - len(chosen),
        same=len(same_ids) - same_chosen,
        errors=tuple(sorted(errors)),
        chosen=len(chosen),
        same_chosen=same_chosen,
        note=_note_on_small_sample(folder, chosen),
    )


def _note_on_small_sample(folder: RunFolder, chosen_ids: Collection[str]) -> str:
    """Say what the sample of a small plan can exclude, and which fault types are not in it.

    Only what this folder forked counts: of those, each drawn experiment was equally likely.
    """
    if folder.head.experiments >= SMALL_PLAN_SIZE:
        return ""
    sample_ids, timings = sample_ids_in_folder(folder), folder.timings()
    forked_ids = {name for name in folder.planned_positions() if was_forked(timings.get(name, {}))}
    proven_ids = forked_ids.intersection(sample_ids)
    notes = []
    if count := len(sample_ids) - len(proven_ids):
        notes.append(f"{count} of them had run on that engine before, which proves nothing")
    if proven_ids != forked_ids:
        notes.append(_describe_exclusion(len(forked_ids), len(proven_ids.difference(chosen_ids))))
        notes += _describe_uncovered_fault_types(folder, forked_ids, proven_ids)
    return "; ".join(notes)


def _describe_exclusion(count: int, drawn_count: int) -> str:
    if not drawn_count:
        return "how many other records an engine could have changed is not known"
    share = _share_found(count, drawn_count)
    return (
        f"an engine that changes {share:.0%} of the records or more would have been noticed with a chance of "
        f"{_CONFIDENCE:.0%}"
    )


def _describe_uncovered_fault_types(
    folder: RunFolder, forked_ids: Collection[str], proven_ids: Collection[str]
) -> list[str]:
    forked = [e for e in plan_file.iterate_experiments(folder.path) if e.id in forked_ids]
    covered = {_fault_type_of(experiment) for experiment in forked if experiment.id in proven_ids}
    uncovered = sorted({_fault_type_of(experiment) for experiment in forked} - covered)
    return [f"no sample of {', '.join(uncovered)}"] if uncovered else []


def _share_found(count: int, sample_size: int) -> float:
    """Return the smallest share of changed records that a sample drawn from `count` records would find."""
    for changed in range(1, count + 1):
        missed = comb(count - changed, sample_size) / comb(count, sample_size)
        if 1.0 - missed >= _CONFIDENCE:
            return changed / count
    return 1.0


def _fault_type_of(experiment: Experiment) -> str:
    return f"{experiment.fault.module}/{experiment.fault.fault_type}"


def describe_difference(record: Record, reference_record: Record) -> str:
    names = [name for name in Record.__slots__ if getattr(record, name) != getattr(reference_record, name)]
    return f"{names[0]} {getattr(record, names[0])!r} instead of {getattr(reference_record, names[0])!r}"


def _is_result(record: Record) -> bool:
    return record.status is not Status.HARNESS_ERROR
