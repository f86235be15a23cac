"""Paths of faults in a report: of each experiment for the page, counted by fault type for the figure."""

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from mutator.model import Experiment, Record
from mutator.outcomes.paths import Passage, Path, State, Ways, ways_of
from mutator.outcomes.rows import Row, by_fault_type
from mutator.store.run_folder import RunFolder

SCHEMA = "report-paths/1"
ALL = "all fault types"


@dataclass(frozen=True, kw_only=True)
class FoundPaths:
    """The paths of a run by experiment, those that there are; `records` has what left golden."""

    ways: Ways
    channels: Sequence[Sequence[str]]  # as run.json has them
    by_id: Mapping[str, Path]
    records: Mapping[str, Record]

    @classmethod
    def of(
        cls, folder: RunFolder, experiments: Mapping[str, Experiment], records: Mapping[str, Record]
    ) -> "FoundPaths | None":
        """Those of a run folder with these plan and records; None where no path can be known."""
        ways = ways_of(folder.head)
        if ways is None:
            return None
        found = ((name, ways.path(e, records[name])) for name, e in experiments.items() if name in records)
        by_id = {name: path for name, path in found if path is not None}
        return cls(ways=ways, channels=folder.head["channels"], by_id=by_id, records=records)

    def through(self, experiment_id: str) -> str:
        """The links that a fault got through, joined by `;`: what the page filters by."""
        path = self.by_id.get(experiment_id)
        crossings = path.crossings if path else ()
        return ";".join(link_text(c.tail, c.tip) for c in crossings if c.passage is Passage.THROUGH)

    def data(self, ids: Sequence[str]) -> dict[str, Any]:
        """What the page has of the experiments `ids`: the shape of each path (-1: none), columns of first
        times and largest deviations, one for each channel, and by row the components that had changed before
        their channels show it, with the times by which they had."""
        shapes: dict[str, int] = {}
        columns: dict[str, Any] = {}
        codes = []
        for name in ids:
            path = self.by_id.get(name)
            stages = [[s.component, s.state.value, column] for s, column in _placed(path)] if path else []
            key = repr(stages)
            codes.append(shapes.setdefault(key, len(shapes)) if stages else -1)
            columns.setdefault(key, stages)
        known = [self.records[one].left if one in self.records else () for one in ids]
        left = [{name: rest for name, *rest in departures} for departures in known]
        names = [name for name, *_ in self.channels]
        return {
            "schema": SCHEMA,
            "components": self.components,
            "channels": [[name, unit, component, about] for name, unit, _, component, about in self.channels],
            "by": {row: late for row, name in enumerate(ids) if (late := self._late(name))},
            "shapes": [columns[key] for key in shapes],
            "shape": codes,
            "first": [[round(one[name][0], 4) if name in one else None for one in left] for name in names],
            "largest": [[_short(one[name][1]) if name in one else None for one in left] for name in names],
        }

    def _late(self, experiment_id: str) -> dict[str, float]:
        path = self.by_id.get(experiment_id)
        return {s.component: round(s.t_by, 4) for s in (path.stages if path else ()) if s.t_by is not None}

    def label(self, component: str) -> str:
        """What pages call a component."""
        return self.components[component]["label"]

    @cached_property
    def components(self) -> dict[str, dict[str, str]]:
        """Label and meaning of each component."""
        structure = self.ways.structure
        if structure is None:
            return {name: {"label": name, "about": ""} for _, _, _, name, _ in self.channels if name}
        return {name: {"label": c.label, "about": c.about} for name, c in structure.components.items()}


def link_text(tail: str, tip: str) -> str:
    """What lists and filters call a link."""
    return f"{tail}→{tip}"


def _short(value: float) -> float | str:
    return float(f"{value:.3g}") if math.isfinite(value) else "Infinity"


def _placed(path: Path) -> Iterator[tuple[Any, int]]:
    """The stages, each with its column in a strip: one to the right of the last that feeds it."""
    columns: dict[str, int] = {}
    for stage in path.stages:
        feeders = (c.tail for c in path.crossings if c.tip == stage.component)
        columns[stage.component] = 1 + max((columns.get(name, -1) for name in feeders), default=-1)
        yield stage, columns[stage.component]


@dataclass(slots=True, kw_only=True)
class PathCounts:
    """Of the paths of some faults: at each link, how many `came` to its start (where its end is recorded) and
    got `through`; at each component, how many were `injected` there, came to it and were `stopped`, and how
    many of these were `masked` there: they changed no actuator. `ends` counts masked faults by all that
    stopped them."""

    active: int = 0
    came: Counter[str] = field(default_factory=Counter)
    through: Counter[str] = field(default_factory=Counter)
    injected: Counter[str] = field(default_factory=Counter)
    stopped: Counter[str] = field(default_factory=Counter)
    masked: Counter[str] = field(default_factory=Counter)
    ends: Counter[tuple[str, ...]] = field(default_factory=Counter)

    def add(self, path: Path) -> None:
        """Count one more path."""
        self.active += 1
        self.came.update(c.link for c in path.crossings if c.passage in (Passage.THROUGH, Passage.STOPPED))
        self.through.update(c.link for c in path.crossings if c.passage is Passage.THROUGH)
        self.injected.update(s.component for s in path.stages if s.state is State.INJECTED)
        stopped = {c.tip for c in path.crossings if c.passage is Passage.STOPPED}
        self.stopped.update(stopped.union(path.stopped_at))
        self.masked.update(path.stopped_at)
        self.ends.update([path.stopped_at] if path.stopped_at else ())

    def plain(self) -> dict[str, Any]:
        """For the page."""
        links = {name: [self.through[name], came] for name, came in self.came.items()}
        names = dict.fromkeys((*self.injected, *sorted(self.stopped)))
        components = {n: [self.injected[n], self.stopped[n], self.masked[n]] for n in names}
        return {"active": self.active, "links": links, "components": components}


def counts_by_fault_type(rows: Iterable[Row], paths: FoundPaths) -> dict[str, PathCounts]:
    """The counts of all faults, then those of each fault type by its name."""
    found: dict[str, PathCounts] = defaultdict(PathCounts)
    for row in sorted(rows, key=by_fault_type):
        if (path := paths.by_id.get(row.experiment_id)) is not None:
            found[ALL].add(path)
            found[by_fault_type(row)].add(path)
    return dict(found)
