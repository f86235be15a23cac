"""Searches that drew their faults at random, beside which a report shows a search: they have the same planes
and sources, and are in the same folder of runs.

They are read when a report is written, and stored beside it as `random_searches.json`, from which the report
can be built again without them. The seal does not cover it.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

from mutator._common.confined_files import read_below
from mutator._common.files import json_bytes, parse_json_object
from mutator._common.hashing import as_json_types
from mutator._common.typed_json import typed_value_from_json
from mutator.campaigns.bench_files import load_campaign_of_run
from mutator.campaigns.exploration_section import ExplorationSection, ExploredPlane
from mutator.errors import MutatorError, TypeMisfit
from mutator.explore.exploration_replay import replay_exploration
from mutator.explore.finding_search import RANDOM, FindingSearch
from mutator.report.panel import REPORT_FOLDER
from mutator.report.run_history import run_folders
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

RANDOM_SEARCHES_FILE, _SCHEMA = "random_searches.json", "random-searches/1"
_MOST_SEARCHES = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomSearch:
    """A search that drew its faults at random: the run's name, and its number of findings after each run."""

    name: str
    counts: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomSearches:
    """Those beside which a search is shown, by name."""

    searches: tuple[RandomSearch, ...] = ()

    def as_bytes(self) -> bytes:
        return json_bytes({"schema": _SCHEMA, **as_json_types(self)})


def find_random_searches(folder: RunFolder, workspace: Workspace | None) -> RandomSearches:
    """Return the first ten random searches in the folder of a search that have the same planes, reading and
    sources, without those that cannot be read; none for other runs, and for a random search itself.
    """
    section = _search_of(folder)
    if section is None or section.strategy == RANDOM or workspace is None:
        return RandomSearches()
    searches: list[RandomSearch] = []
    for path in run_folders(folder.path.resolve().parent):
        with suppress(MutatorError, LookupError, TypeError, ValueError):  # the other run is damaged
            other = RunFolder.open(path)
            if _is_counterpart(_search_of(other), section) and _injects_the_same(other, folder):
                replay = replay_exploration(other, workspace.manifest_of(other.head))
                if isinstance(replay.exploration, FindingSearch) and not replay.differences:
                    counts = tuple(replay.exploration.finding_counts())
                    searches += [RandomSearch(name=path.name, counts=counts)] if counts else []
        if len(searches) == _MOST_SEARCHES:
            break
    return RandomSearches(searches=tuple(searches))


def stored_random_searches(folder: RunFolder) -> RandomSearches:
    """Read those that the stored report shows; none without any, or if they cannot be read."""
    name = f"{REPORT_FOLDER}/{RANDOM_SEARCHES_FILE}"
    try:
        stored = parse_json_object(read_below(folder.path, name), folder.path / name, _SCHEMA)
        beside = typed_value_from_json(RandomSearches, {k: v for k, v in stored.items() if k != "schema"})
    except (OSError, MutatorError, TypeMisfit):
        return RandomSearches()
    return beside if all(map(_has_counts, beside.searches)) else RandomSearches()


def _has_counts(search: RandomSearch) -> bool:
    """Whether the counts of a stored search can be those of one: from one run to the next, none is lost."""
    return bool(search.counts) and all(a <= b for a, b in pairwise((0, *search.counts)))


def _search_of(folder: RunFolder) -> ExplorationSection | None:
    section = load_campaign_of_run(folder).exploration if folder.is_bench else None
    return section if section and section.goal == "find" else None


def _is_counterpart(other: ExplorationSection | None, section: ExplorationSection) -> bool:
    return (
        other is not None
        and other.strategy == RANDOM
        and other.observe_s == section.observe_s
        and _without_seeds(other.planes) == _without_seeds(section.planes)
    )


def _injects_the_same(other: RunFolder, folder: RunFolder) -> bool:
    """Whether target, models and reading are the same, so that names and values mean the same faults."""
    return (other.head.sources, other.head.reading) == (folder.head.sources, folder.head.reading)


def _without_seeds(planes: Sequence[ExploredPlane]) -> list[ExploredPlane]:
    return [replace(plane, seed=0) for plane in planes]
