"""The equivalence check: rerun a sample of a campaign's experiments on the reference engine.

Every record of the sample must be the same, including the trace digest. The check's runs use nothing from
other runs (`entry.independent` of the manifest), so the check also covers data that other runs share. Its
records are in the run's folder `proof/`, which is removed if no experiment was forked.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby
from pathlib import Path

from mutator._common.files import raising_disk_full, remove_folder
from mutator._common.hashing import digest
from mutator._common.message_text import counted
from mutator.campaigns.sampling import pick
from mutator.engines.engine_jobs import RunMode
from mutator.errors import CheckFailed
from mutator.model import Experiment, Record, Status
from mutator.store import file_digests, plan_file
from mutator.store.records import PROOF_FOLDER, endings_of
from mutator.store.run_folder import RunFolder

FOLDER = PROOF_FOLDER
_LEAST = 20
_SHARE = 100  # one experiment in this many


@dataclass(frozen=True, slots=True)
class Sample:
    """An experiment of the sample that has not run yet."""

    number: int
    id: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Proof:
    """The state of a run's equivalence check: the number of experiments in the sample, the number with the
    same result, and the harness errors of the check's own runs (experiment id, detail).
    """

    sampled: int
    same: int
    errors: tuple[tuple[str, str], ...] = ()

    @property
    def whole(self) -> bool:
        return self.same == self.sampled

    def __str__(self) -> str:
        sampled = counted(self.sampled, "experiment")
        return f"{self.same} of {sampled} came out the same on the reference engine"


def begin(run: Path) -> None:
    """Record that the run has results that need an equivalence check."""
    with raising_disk_full(run):
        (run / FOLDER).mkdir(exist_ok=True)


def sample(experiments: Sequence[Experiment], seed: int) -> tuple[Experiment, ...]:
    """Choose one experiment in a hundred, at least 20, with every fault type and every scenario."""
    count = max(_LEAST, -(-len(experiments) // _SHARE))
    chosen = list(pick(experiments, count, seed))
    seen = {mark for experiment in chosen for mark in _marks(experiment)}
    for experiment in sorted(experiments, key=lambda e: digest([seed, e.id])):
        if not seen.issuperset(_marks(experiment)):
            chosen.append(experiment)
            seen.update(_marks(experiment))
    return tuple(chosen)


def _sample_of(folder: RunFolder) -> set[str]:
    """Ids of a plan's sample. For several seeds, each seed after the first adds one experiment in a
    hundred.
    """
    return set(_sampled_ids(folder.path, folder.head.plan, len(folder.seeds)))


@lru_cache(maxsize=4)  # a session asks several times
def _sampled_ids(run: Path, plan: str, seeds: int) -> tuple[str, ...]:
    if seeds == 1:
        head = RunFolder.open_unverified(run).head
        return tuple(e.id for e in sample(plan_file.load_experiments(run), head.seed))
    found: list[str] = []
    for seed, group in groupby(plan_file.iterate_experiments(run), key=lambda experiment: experiment.seed):
        some = tuple(group)
        more = pick(some, -(-len(some) // _SHARE), seed) if found else sample(some, seed)
        found += [experiment.id for experiment in more]
    return tuple(found)


def _marks(experiment: Experiment) -> Iterator[tuple[str, ...]]:
    yield (experiment.fault.module, experiment.fault.fault_type)
    yield (experiment.scenario,)


def needless(folder: RunFolder) -> str | None:
    """Return the most frequent reason why no experiment was forked; None if one was forked or still can be.

    Always None for a shard, because merged shards must all have a proof or none.
    """
    if folder.shard is not None:
        return None
    told = folder.timings()
    done = {one.experiment_id for one in endings_of(folder.records()) if one.is_final}
    reasons = Counter[str]()
    for name in folder.planned_positions():
        if name not in done:  # not run yet; any timing is from an earlier session
            return None
        line = told.get(name, {})
        if line.get("engine", "unknown") not in (RunMode.REFERENCE.value, None):
            return None
        reasons[str(line.get("why", ""))] += 1
    return next((why for why, _ in reasons.most_common() if why), "the reference engine ran them all")


def drop(folder: RunFolder) -> None:
    """Remove a proof that is no longer needed."""
    gone = {name: None for name in file_digests.list_segments(folder.path) if name.startswith(f"{FOLDER}/")}
    with file_digests.rewriting_files(folder.path, gone):
        remove_folder(folder.path / FOLDER)


def left(folder: RunFolder) -> tuple[Sample, ...]:
    """Return the part of the sample without a valid record in `proof/`; empty if no check is needed."""
    if not (folder.path / FOLDER).is_dir():
        return ()
    found = folder.records(FOLDER)
    ids = [name for name in sampled(folder) if name not in found or not _counts(found[name])]
    if ids and needless(folder) is not None:
        return ()
    return tuple(Sample(number, name) for number, name in enumerate(ids))


def sampled(folder: RunFolder) -> list[str]:
    """Ids of the sample in this folder's share, in plan order."""
    wanted = _sample_of(folder)
    return [name for name in folder.planned_positions() if name in wanted]


def judge(folder: RunFolder, records: Mapping[str, Record]) -> Proof | None:
    """Return the state of the check; None if none is needed. CheckFailed if a record differs on the reference
    engine.
    """
    if not (folder.path / FOLDER).is_dir():
        return None
    found = folder.records(FOLDER)
    same, errors = 0, []
    for name, truth in found.items():
        record = records.get(name)
        if record is None or not _counts(record):
            continue
        if not _counts(truth):
            errors.append((name, f"in the proof: {truth.detail}"))
            continue
        if record != truth:
            raise CheckFailed(
                f"experiment {name} differs on the reference engine: {difference(record, truth)}",
                where=folder.path,
                expected="the same record from every engine",
                remedy="do not trust this run: rerun it with --engine reference, and report the problem",
            )
        same += 1
    return Proof(sampled=len(sampled(folder)), same=same, errors=tuple(sorted(errors)))


def difference(record: Record, truth: Record) -> str:
    names = [name for name in Record.__slots__ if getattr(record, name) != getattr(truth, name)]
    return f"{names[0]} {getattr(record, names[0])!r} instead of {getattr(truth, names[0])!r}"


def _counts(record: Record) -> bool:
    return record.status is not Status.HARNESS_ERROR
