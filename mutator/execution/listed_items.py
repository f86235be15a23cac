"""The items of a campaign under pytest, before anything runs: most are single experiments.

Workers import this, so it reads no YAML.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

from mutator.campaigns.chunks import PendingChunk, golden_key_by_chunk
from mutator.model import Experiment, Fault, Method
from mutator.store import plan_file
from mutator.store.golden_runs import GoldenRun
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN_FILE

MOST_SINGLE_ITEMS = 20_000  # pytest keeps each item in memory; of larger plans, chunks are items
_ID_LENGTH = 8  # characters of an id in a name; more where two agree
_MOST_VALUE_LENGTH = 40
_OTHER_CHARACTERS = re.compile(r"[^A-Za-z0-9.+_-]+")  # what names and markers cannot contain
_MARKER = re.compile(r"[A-Za-z_]\w*", re.ASCII)

SourcePlace = tuple[str, int | None]  # the file that describes a fault, and the line, from 1


@dataclass(frozen=True, slots=True, kw_only=True)
class ListedItem:
    """An item. `positions` are those of its experiments in the plan, which have the golden run `golden_key`.

    `-m` selects it by `markers`, `-k` also by `keywords`. `place` is where an editor goes.
    """

    name: str
    positions: tuple[int, ...]
    golden_key: str
    markers: tuple[str, ...] = ()
    keywords: tuple[str, ...] = ()
    place: SourcePlace = ("", None)


@dataclass(frozen=True, slots=True, kw_only=True)
class ItemListing:
    """All items of a campaign. `plan` is the digest of its plan; `problem` is why it cannot be planned."""

    plan: str = ""
    items: tuple[ListedItem, ...] = ()
    problem: str = ""


class PlaceFinder(Protocol):
    """Finds the file and line that describe a fault."""

    def __call__(self, fault: Fault) -> SourcePlace: ...


def list_experiments(
    numbered: Sequence[tuple[int, Experiment]], *, several_seeds: bool, place_of: PlaceFinder
) -> tuple[ListedItem, ...]:
    """List experiments of a plan, which come with their positions."""
    ids = _shortest_ids([experiment.id for _, experiment in numbered])
    return tuple(
        ListedItem(
            name=f"{_label(experiment)}-{short_id}",
            positions=(position,),
            golden_key=GoldenRun.for_experiment(experiment, several_seeds=several_seeds).key,
            markers=_markers(experiment),
            keywords=(experiment.fault.spec, experiment.id),
            place=place_of(experiment.fault),
        )
        for (position, experiment), short_id in zip(numbered, ids, strict=True)
    )


def list_plan(
    numbered: Sequence[tuple[int, Experiment]],
    chunk_lengths: Iterable[int],
    *,
    several_seeds: bool,
    place_of: PlaceFinder,
) -> tuple[ListedItem, ...]:
    """List a plan, or a shard of it: its experiments or, of a large plan, its chunks."""
    if len(numbered) <= MOST_SINGLE_ITEMS:
        return list_experiments(numbered, several_seeds=several_seeds, place_of=place_of)
    experiments, items, begin = dict(numbered), [], 0
    for number, count in enumerate(chunk_lengths):
        positions = tuple(i for i in range(begin, begin + count) if i in experiments)
        begin += count
        if positions:
            golden = GoldenRun.for_experiment(experiments[positions[0]], several_seeds=several_seeds)
            items.append(ListedItem(name=_chunk_name(number), positions=positions, golden_key=golden.key))
    return tuple(items)


def positions_in_plan(folder: RunFolder, chunks: Iterable[PendingChunk]) -> dict[int, tuple[int, ...]]:
    """Return the positions of the pending experiments in the plan, by chunk index."""
    begins, begin = [], 0
    for _, _, count in folder.head.chunks:
        begins.append(begin)
        begin += count
    return {
        chunk.chunk_index: tuple(begins[chunk.chunk_index] + i for i in chunk.pending_positions)
        for chunk in chunks
    }


def list_chunks(folder: RunFolder, pending: Sequence[PendingChunk]) -> tuple[ListedItem, ...]:
    """List the pending chunks of a large plan as items."""
    golden_keys, positions = golden_key_by_chunk(folder, pending), positions_in_plan(folder, pending)
    return tuple(
        ListedItem(
            name=_chunk_name(chunk.chunk_index),
            positions=positions[chunk.chunk_index],
            golden_key=golden_keys[chunk.chunk_index],
        )
        for chunk in pending
    )


def list_selected(
    folder: RunFolder, positions: Iterable[int], place_of: PlaceFinder
) -> tuple[ListedItem, ...]:
    """List the experiments of a frozen plan at these positions, in this order."""
    ordered = list(dict.fromkeys(positions))
    selected, planned = set(ordered), enumerate(plan_file.iterate_experiments(folder.path))
    experiments = {position: experiment for position, experiment in planned if position in selected}
    numbered = [(position, experiments[position]) for position in ordered]
    return list_experiments(numbered, several_seeds=folder.has_seeded_goldens, place_of=place_of)


def place_in_run_folder(folder: RunFolder) -> PlaceFinder:
    """Return a finder for a plan whose library is not looked at."""
    place = (str(folder.path / CAMPAIGN_FILE), None)
    return lambda fault: place


def _chunk_name(number: int) -> str:
    return f"chunk-{number:05d}"


def _label(experiment: Experiment) -> str:
    fault = experiment.fault
    value = "" if fault.value in (None, "") else f"{fault.value}{'' if fault.unit == '-' else fault.unit}"
    trigger = experiment.trigger.name.removeprefix(f"{experiment.method.value}/")
    parts = (fault.fault_type, value[:_MOST_VALUE_LENGTH], experiment.scenario, trigger)
    return f"{_plain(fault.module)}/{'-'.join(filter(None, map(_plain, parts)))}"


def _plain(text: str) -> str:
    return _OTHER_CHARACTERS.sub("_", text.replace(" ", "")).strip("_")


def _markers(experiment: Experiment) -> tuple[str, ...]:
    """Return module, fault type, scenario, method and, of a guided trigger, the context."""
    fault, names = experiment.fault, [experiment.scenario, experiment.method.value]
    if experiment.method is Method.GUIDED:
        names.append(experiment.trigger.name.removeprefix(f"{experiment.method.value}/"))
    return tuple(filter(is_marker, (fault.module, fault.fault_type, *names)))


def is_marker(name: str) -> bool:
    """Whether `-m` can select by a name."""
    return _MARKER.fullmatch(name) is not None


def _shortest_ids(ids: Sequence[str]) -> list[str]:
    """Return the first eight characters of each id, and more of those that begin with the same ones."""
    shortened = [name[:_ID_LENGTH] for name in ids]
    counts: dict[str, int] = {}
    for name in shortened:
        counts[name] = counts.get(name, 0) + 1
    return [full if counts[short] > 1 else short for full, short in zip(ids, shortened, strict=True)]
