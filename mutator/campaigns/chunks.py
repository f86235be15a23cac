"""Chunks: the experiments that one pytest item runs."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

from mutator.model import Experiment, Record
from mutator.store import plan_file
from mutator.store.records import endings_of
from mutator.store.run_folder import RunFolder


def cut(groups: Sequence[Hashable], size: int) -> tuple[int, ...]:
    """Return the lengths of a plan's chunks: at most `size` experiments each; no chunk spans two groups.

    The experiments of a group share a golden run, so an engine can share work within a chunk.
    """
    lengths: list[int] = []
    for i, group in enumerate(groups):
        if i and group == groups[i - 1] and lengths[-1] < size:
            lengths[-1] += 1
        else:
            lengths.append(1)
    return tuple(lengths)


def cut_runs(runs: Sequence[Sequence[Experiment]], size: int) -> tuple[int, ...]:
    """Return the number of experiments in each chunk of at most `size` runs. No chunk splits a shared run."""
    lengths = iter([len(same) for same in runs])
    counts = cut([(same[0].scenario, same[0].changes) for same in runs], size)
    return tuple(sum(islice(lengths, count)) for count in counts)


@dataclass(frozen=True, slots=True)
class Pending:
    """The unfinished part of a chunk."""

    chunk: int
    places: tuple[int, ...]  # positions in the chunk


def pending(folder: RunFolder, records: Mapping[str, Record]) -> tuple[Pending, ...]:
    """Return the chunks of the folder's shard that still have experiments to run.

    Experiments to run are those without a record, and harness errors, which are retried.
    """
    done = {one.experiment_id for one in endings_of(records) if one.is_final}
    names = plan_file.ids(folder.path) if done else None
    shard = folder.shard
    left: list[Pending] = []
    for index, (_, _, count) in enumerate(folder.head.chunks):
        if names is None:
            places = tuple(range(count))
        else:
            places = tuple(i for i in range(count) if next(names) not in done)
        if places and (shard is None or shard.has_chunk(index)):
            left.append(Pending(index, places))
    return tuple(left)
