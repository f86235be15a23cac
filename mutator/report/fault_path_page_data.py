"""The fault paths of a report: one for each experiment on the page, and counts by fault type."""

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from mutator.model import Experiment, Record
from mutator.outcomes.fault_paths import ComponentState, FaultPath, FaultPathFinder, LinkState, UntimedPath
from mutator.store.run_folder import RunFolder
from mutator.targets.stored_target_facts import ChannelFacts

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

PATHS_SCHEMA = "report-paths/1"
ALL_FAULT_TYPES = "all fault types"
_CHANGED_BY_FAULT = (ComponentState.REACHED, ComponentState.PASSED)


class _LazyFaultPaths(Mapping[str, FaultPath]):
    """The paths of experiments, computed on access."""

    def __init__(
        self, fault_paths: FaultPathFinder, planned: Mapping[str, Experiment], records: Mapping[str, Record]
    ) -> None:
        self._fault_paths, self._planned, self._records = fault_paths, planned, records
        self._last: tuple[str, FaultPath | None] | None = None

    def __getitem__(self, name: str) -> FaultPath:
        last = self._last
        if last is None or last[0] != name:
            self._last = last = name, self._fault_paths.fault_path(self._planned[name], self._records[name])
        path = last[1]
        if path is None:
            raise KeyError(name)
        return path

    def __iter__(self) -> Iterator[str]:
        return (name for name in self._planned if name in self)

    def __len__(self) -> int:
        return sum(1 for _ in self)


@dataclass(frozen=True, kw_only=True)
class RunFaultPaths:
    """The known paths of a run, and the distinct untimed paths of its experiments."""

    fault_paths: FaultPathFinder
    channels: Sequence[ChannelFacts]
    path_by_experiment: Mapping[str, FaultPath]
    records: Mapping[str, Record]
    distinct_untimed_paths: Sequence[UntimedPath] = ()

    @classmethod
    def of(
        cls,
        folder: RunFolder,
        fault_paths: FaultPathFinder,
        planned: Mapping[str, Experiment],
        records: Mapping[str, Record],
        untimed_paths: Sequence[UntimedPath],
    ) -> "RunFaultPaths":
        by_id = _LazyFaultPaths(fault_paths, planned, records)
        return cls(
            fault_paths=fault_paths,
            channels=folder.head.channels,
            path_by_experiment=by_id,
            records=records,
            distinct_untimed_paths=untimed_paths,
        )

    def joined_passed_links(self, untimed_path_indices: Iterable[int]) -> list[str]:
        """Return the links that each fault got through, joined by `;`. The page filters by them."""
        texts = [
            ";".join(link_name(c.tail, c.tip) for c in path.links if c.state is LinkState.THROUGH)
            for path in self.distinct_untimed_paths
        ]
        return [texts[number] if number >= 0 else "" for number in untimed_path_indices]

    def page_data(self, ids: Sequence[str]) -> dict[str, Any]:
        """Return the page's data for the experiments `ids`: the shape of each path (-1: none), and for each
        channel a column of first times and a column of largest deviations. `by` lists the components that
        must have changed before their own channels did, with the latest possible time.
        """
        shapes: dict[str, int] = {}
        columns: dict[str, Any] = {}
        shape_codes, latest_times_by_row, names = [], {}, [channel.name for channel in self.channels]
        first_times: list[list[float | None]] = [[] for _ in names]
        largest_deviations: list[list[float | str | None]] = [[] for _ in names]
        for row, name in enumerate(ids):
            path = self.path_by_experiment.get(name)
            components = (
                [[s.name, s.state.value, column] for s, column in _components_with_columns(path)]
                if path
                else []
            )
            key = repr(components)
            shape_codes.append(shapes.setdefault(key, len(shapes)) if components else -1)
            columns.setdefault(key, components)
            if latest_times := self._latest_time_by_component(path):
                latest_times_by_row[row] = latest_times
            departures = self.records[name].left if name in self.records else ()
            departures_by_channel = {channel: (time, most) for channel, time, most in departures}
            for place, channel in enumerate(names):
                time, most = departures_by_channel.get(channel, (None, None))
                first_times[place].append(None if time is None else round(time, 4))
                largest_deviations[place].append(None if most is None else _rounded(most))
        return {
            "schema": PATHS_SCHEMA,
            "components": self.components,
            "channels": [[c.name, c.unit, c.component, c.about] for c in self.channels],
            "by": latest_times_by_row,
            "shapes": [columns[key] for key in shapes],
            "shape": shape_codes,
            "first": first_times,
            "largest": largest_deviations,
        }

    @staticmethod
    def _latest_time_by_component(path: FaultPath | None) -> dict[str, float]:
        return {
            s.name: round(s.t_changed_by, 4)
            for s in (path.components if path else ())
            if s.t_changed_by is not None
        }

    def component_label(self, component: str) -> str:
        """Return the name of a component on pages."""
        return self.components[component]["label"]

    @cached_property
    def components(self) -> dict[str, dict[str, str]]:
        """Label and meaning of each component."""
        structure = self.fault_paths.structure
        if structure is None:
            return {name: {"label": name, "about": ""} for c in self.channels if (name := c.component)}
        return {name: {"label": c.label, "about": c.about} for name, c in structure.components.items()}


def link_name(tail: str, tip: str) -> str:
    """Return the name of a link in lists and filters."""
    return f"{tail}→{tip}"


def _rounded(value: float) -> float | str:
    return float(f"{value:.3g}") if math.isfinite(value) else "Infinity"


def _components_with_columns(path: FaultPath) -> Iterator[tuple[Any, int]]:
    """Yield each component and its column on the page, to the right of all that feed it."""
    columns: dict[str, int] = {}
    for component in path.components:
        feeders = (c.tail for c in path.links if c.tip == component.name)
        columns[component.name] = 1 + max((columns.get(name, -1) for name in feeders), default=-1)
        yield component, columns[component.name]


@dataclass(slots=True, kw_only=True)
class PathCounts:
    """Counts over the paths of some faults. By link: how many reached its start, and how many passed it if
    its end is recorded. By component: how many came there by a link, came there by none of them (by links
    that are not studied, such as engagement), were injected, stopped, and masked there.
    `masked_by_component_set` counts masked faults by the set of components that stopped them.
    `is_sample`: the faults are a sample, or an exploration chose them, so that counts of links have no rate
    of all.
    """

    is_sample: bool = False
    active_fault_count: int = 0
    reached_by_link: Counter[str] = field(default_factory=Counter)
    passed_by_link: Counter[str] = field(default_factory=Counter)
    entered_by_component: Counter[str] = field(default_factory=Counter)
    entered_otherwise_by_component: Counter[str] = field(default_factory=Counter)
    injected_by_component: Counter[str] = field(default_factory=Counter)
    stopped_by_component: Counter[str] = field(default_factory=Counter)
    masked_by_component: Counter[str] = field(default_factory=Counter)
    masked_by_component_set: Counter[tuple[str, ...]] = field(default_factory=Counter)

    def add(self, path: FaultPath | UntimedPath, count: int = 1) -> None:
        self.active_fault_count += count
        link_states = [(c.name, c.tip, c.state) for c in path.links]
        entered = {tip for _, tip, state in link_states if state is LinkState.THROUGH}
        stopped = {tip for _, tip, state in link_states if state is LinkState.STOPPED}
        changed = {n for n, state in path.state_by_component.items() if state in _CHANGED_BY_FAULT}
        behind_links = {tip for _, tip, _ in link_states} if path.injected else set()
        for counter, names in (
            (
                self.reached_by_link,
                [n for n, _, state in link_states if state in (LinkState.THROUGH, LinkState.STOPPED)],
            ),
            (self.passed_by_link, [name for name, _, state in link_states if state is LinkState.THROUGH]),
            (self.entered_by_component, entered),
            (self.entered_otherwise_by_component, (changed & behind_links) - entered),
            (self.injected_by_component, path.injected),
            (self.stopped_by_component, stopped.union(path.stopped_at)),
            (self.masked_by_component, path.stopped_at),
        ):
            for name in names:
                counter[name] += count
        if path.stopped_at:
            self.masked_by_component_set[path.stopped_at] += count


def path_counts_by_fault_type(
    fault_types: "pd.Series[str]",
    untimed_path_indices: "np.ndarray",
    paths: RunFaultPaths,
    *,
    is_sample: bool = False,
) -> Mapping[str, PathCounts]:
    """Return counts of all faults, then by fault type. `untimed_path_indices`: the path of each row or -1."""
    import pandas as pd

    counts: dict[str, PathCounts] = defaultdict(lambda: PathCounts(is_sample=is_sample))
    rows = pd.DataFrame({"kind": fault_types.to_numpy(), "untimed_path": untimed_path_indices})
    for kind, group in rows[rows["untimed_path"] >= 0].groupby("kind"):
        for code, count in group["untimed_path"].value_counts(sort=False).items():
            for name in (ALL_FAULT_TYPES, str(kind)):
                counts[name].add(paths.distinct_untimed_paths[int(str(code))], int(count))
    return dict(counts)
