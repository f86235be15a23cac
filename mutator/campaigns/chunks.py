"""Chunks: consecutive experiments of a plan with the same golden run. A shard has whole chunks."""

from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import islice

from mutator.model import Experiment, Record
from mutator.store import plan_file
from mutator.store.plan_lines import parse_experiment
from mutator.store.records import endings_of
from mutator.store.run_folder import RunFolder


def chunk_lengths(group_of_each: Sequence[Hashable], size: int) -> tuple[int, ...]:
    """Return the lengths of a plan's chunks: at most `size` experiments each; no chunk spans two groups.

    The experiments of a group share a golden run, so an engine can share work within a chunk.
    """
    lengths: list[int] = []
    for i, group in enumerate(group_of_each):
        if i and group == group_of_each[i - 1] and lengths[-1] < size:
            lengths[-1] += 1
        else:
            lengths.append(1)
    return tuple(lengths)


def chunk_lengths_of_runs(experiments_by_run: Sequence[Sequence[Experiment]], size: int) -> tuple[int, ...]:
    """Return the number of experiments in each chunk of at most `size` runs. No chunk splits a shared run."""
    lengths = iter([len(same) for same in experiments_by_run])
    counts = chunk_lengths([(same[0].scenario, same[0].changes) for same in experiments_by_run], size)
    return tuple(sum(islice(lengths, count)) for count in counts)


@dataclass(frozen=True, slots=True)
class PendingChunk:
    """The unfinished part of a chunk."""

    chunk_index: int
    pending_positions: tuple[int, ...]  # of its experiments in the chunk


def pending_chunks_of(
    folder: RunFolder, records: Mapping[str, Record], selected_ids: Collection[str] | None = None
) -> tuple[PendingChunk, ...]:
    """Return the chunks of the folder's shard that still have experiments to run.

    Experiments to run are those without a record, and harness errors, which are retried; of these only the
    selected ones, if any are given.
    """
    finished_ids = {record.experiment_id for record in endings_of(records) if record.is_final}
    # the ids of a large plan take long to read; a new run needs none of them
    reads_ids = bool(finished_ids) or selected_ids is not None
    names = plan_file.experiment_ids(folder.path) if reads_ids else None
    shard = folder.shard
    pending_chunks: list[PendingChunk] = []
    for index, (_, _, count) in enumerate(folder.head.chunks):
        if names is None:
            pending_positions = tuple(range(count))
        else:
            pending_positions = tuple(
                i
                for i, name in enumerate(islice(names, count))
                if name not in finished_ids and (selected_ids is None or name in selected_ids)
            )
        if pending_positions and (shard is None or shard.has_chunk(index)):
            pending_chunks.append(PendingChunk(index, pending_positions))
    return tuple(pending_chunks)


def chunks_with(folder: RunFolder, experiment_ids: Set[str]) -> tuple[PendingChunk, ...]:
    """Return the chunks that have some of these experiments, with their positions."""
    names = plan_file.experiment_ids(folder.path)
    parts = (
        PendingChunk(index, tuple(i for i in range(count) if next(names) in experiment_ids))
        for index, (_, _, count) in enumerate(folder.head.chunks)
    )
    return tuple(part for part in parts if part.pending_positions)


def golden_key_by_chunk(folder: RunFolder, pending: Iterable[PendingChunk]) -> dict[int, str]:
    """Return the key of the golden run that the experiments of each chunk share, by chunk index."""
    faults = plan_file.load_faults(folder.path)
    keys: dict[int, str] = {}
    for index in (work.chunk_index for work in pending):
        [line, *_] = plan_file.read_chunk_lines(folder.path, folder.head.chunks[index])
        keys[index] = folder.golden_run_of(parse_experiment(line, faults)).key
    return keys
