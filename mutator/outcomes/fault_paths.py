"""Find the path of a fault along the control structure, from the injected components to the process.

The path excludes links out of the process (feedback), links from or to people, and links that are not
studied. A change of a component is attributed to feedback if the component left golden only after the
process did, and feedback could reach it no later than the fault could.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from math import inf
from typing import NamedTuple

from mutator.errors import MutatorError
from mutator.model import Experiment, Fault, Outcome, Record
from mutator.outcomes.channel_departures import Departure
from mutator.outcomes.fault_routes import PossibleRoute, chained, links_of, steps_from, structured
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import HEAD, REMEDY
from mutator.stpa.analysis_files import Kind, StructureModel
from mutator.targets.channels import Role
from mutator.targets.target_facts import ChannelFacts


class ComponentState(StrEnum):
    """The effect of the fault at a component."""

    INJECTED = "injected"
    REACHED = "reached"  # one of its channels left golden
    PASSED = "passed"  # none of its channels left golden, but a component that only it feeds did
    FEEDBACK = "feedback"  # one of its channels left golden, but only after the process
    HELD = "held"  # it has channels, and none left golden
    UNSEEN = "unseen"  # it has no recorded channels


class LinkState(StrEnum):
    """Whether the fault got through a link of its path."""

    THROUGH = "through"
    STOPPED = "stopped"
    UNKNOWN = "unknown"  # the end of the link is not recorded
    NONE = "none"  # the fault did not reach the start of the link


@dataclass(frozen=True, slots=True, kw_only=True)
class PathComponent:
    """A component on a path, and its channels that left golden.

    If a component that only this one feeds left golden before this one's own channels did, `t_by` is the time
    (s) when that happened: this component must have changed by then.
    """

    name: str
    state: ComponentState
    channels: tuple[Departure, ...]
    t_by: float | None = None

    @property
    def t_first(self) -> float | None:
        return min((first for _, first, _ in self.channels), default=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class PathLink:
    """A link of a path with its ends, and whether the fault got through."""

    name: str
    tail: str
    tip: str
    state: LinkState


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultPath:
    """The components of a path in causal order, and whether the fault got through each link."""

    components: tuple[PathComponent, ...]
    links: tuple[PathLink, ...]
    reached: str  # of the components that left golden, the nearest to the process; '' if none
    stopped_at: tuple[str, ...]  # the components that held the fault, if it changed no actuator

    @property
    def injected(self) -> tuple[str, ...]:
        return tuple(one.name for one in self.components if one.state is ComponentState.INJECTED)


@dataclass(frozen=True, slots=True, kw_only=True)
class UntimedPath:
    """A path without times. Paths have the same untimed path if they have the same injected components, and
    components left golden in the same order.

    `late` has the components that must have changed before their own channels did, each with the rank of
    `PathComponent.t_by` among all times. `entered` is the link by which the fault reached the first actuator.
    """

    states: Mapping[str, ComponentState]  # in causal order
    late: Mapping[str, int]
    links: tuple[PathLink, ...]
    reached: str
    stopped_at: tuple[str, ...]
    entered: PathLink | None

    @property
    def injected(self) -> tuple[str, ...]:
        return tuple(name for name, state in self.states.items() if state is ComponentState.INJECTED)


class PathInputs(NamedTuple):
    """The facts about an experiment that determine its untimed path."""

    injected: frozenset[str]
    order: tuple[tuple[str, int], ...]  # the rank of the time at which each component left golden
    masked: bool


class FaultPaths:
    """The paths of faults through a target.

    Without a `structure`, the components form a chain: those of internal channels, then those of actuators,
    then those of ground truth. In a chain, the place of injection is unknown.
    """

    def __init__(self, channels: Sequence[ChannelFacts], structure: StructureModel | None) -> None:
        self.component_of = {channel.name: channel.component for channel in channels}
        self._roles = {c.component: c.role for c in channels if c.component}
        self._actuators = {c.component for c in channels if c.role is Role.ACTUATOR}
        self.structure = structure
        self._links = links_of(structure) if structure else {}
        # links from unrecorded components back to the components that feed them
        self._back = [(tip, tail) for tail, tip in self._links.values() if tip not in self._roles]
        self._untimed_path = lru_cache(maxsize=None)(self._untimed_path_of)
        self._where: dict[str, frozenset[str]] = {}  # the components of each fault, by fault id

    @property
    def processes(self) -> frozenset[str]:
        if self.structure is None:
            return frozenset(name for name, role in self._roles.items() if role == Role.TRUTH.value)
        return frozenset(n for n, c in self.structure.components.items() if c.kind is Kind.PROCESS)

    def _injected(self, fault: Fault) -> frozenset[str]:
        if fault.id not in self._where:
            files = {injection.location.path for injection in fault.injections}
            components = self.structure.components if self.structure else {}
            found = frozenset(name for name, one in components.items() if files.intersection(one.modules))
            self._where[fault.id] = found
        return self._where[fault.id]

    def path(self, experiment: Experiment, record: Record) -> FaultPath | None:
        """Return the path of an experiment.

        None if the fault was not active, if the run has no outcome, or if the fault is in no known component.
        """
        untimed_path = self.untimed_path(experiment.fault, record)
        if untimed_path is None:
            return None
        left: dict[str, list[Departure]] = {}
        for departure in record.left:
            left.setdefault(self.component_of.get(departure[0], ""), []).append(departure)
        times = sorted({min(t for _, t, _ in found) for found in left.values()})
        components = [
            PathComponent(
                name=name,
                state=state,
                channels=tuple(left.get(name, ())),
                t_by=times[untimed_path.late[name]] if name in untimed_path.late else None,
            )
            for name, state in untimed_path.states.items()
        ]
        return FaultPath(
            components=tuple(components),
            links=untimed_path.links,
            reached=untimed_path.reached,
            stopped_at=untimed_path.stopped_at,
        )

    def untimed_path(self, fault: Fault, record: Record) -> UntimedPath | None:
        """Return the untimed path of an experiment; None in the same cases as `path`."""
        inputs = self.inputs_of(fault, record)
        return inputs and self.untimed_path_of(inputs)

    def untimed_path_of(self, inputs: PathInputs) -> UntimedPath | None:
        return self._untimed_path(*inputs)

    def inputs_of(self, fault: Fault, record: Record) -> PathInputs | None:
        """Return the inputs of an untimed path; None if the fault was not active or without an outcome."""
        if record.outcome in (None, Outcome.NOT_ACTIVATED):
            return None
        firsts: dict[str, float] = {}
        for channel, first, _ in record.left:
            component = self.component_of.get(channel, "")
            if first < firsts.get(component, inf):
                firsts[component] = first
        place = {time: i for i, time in enumerate(sorted(set(firsts.values())))}
        order = tuple(sorted((name, place[time]) for name, time in firsts.items()))
        return PathInputs(self._injected(fault), order, record.outcome is Outcome.MASKED)

    def _untimed_path_of(
        self, injected: frozenset[str], order: tuple[tuple[str, int], ...], masked: bool
    ) -> UntimedPath | None:
        route = self._route_of(injected)
        if not route.components:
            return None
        times = dict(order)
        latest = self._latest(route, times)
        states, arrived = self._states(route, times.keys(), latest)
        late = {name: _sooner(latest, times, name) for name, state in states.items() if state in _CHANGED}
        changed = [
            n
            for n, state in states.items()
            if n in times and state in (ComponentState.INJECTED, ComponentState.REACHED)
        ]
        links = tuple(
            PathLink(name=name, tail=tail, tip=tip, state=_link_state(tail, tip, states, arrived))
            for name, (tail, tip) in route.links.items()
        )
        through = [c for c in links if c.tip in self._actuators and c.state is LinkState.THROUGH]
        return UntimedPath(
            states=states,
            late={name: int(place) for name, place in late.items() if place is not None},
            links=links,
            reached=min(reversed(changed), key=route.steps.__getitem__, default=""),
            stopped_at=_holding(route, states, arrived) if masked else (),
            entered=min(through, key=lambda c: times.get(c.tip, inf), default=None),
        )

    def _states(
        self, route: PossibleRoute, shown: Collection[str], left: Mapping[str, float]
    ) -> tuple[dict[str, ComponentState], set[str]]:
        """Return the state of each component of a route, and the components that the fault reached.

        `left` has the rank of the time by which each component left golden. Components in `shown` have
        channels that left golden. The fault reaches an unrecorded component if it reached one that feeds it.
        """
        moved = self._moved(left)
        states: dict[str, ComponentState] = {}
        arrived: set[str] = set()
        for name in route.components:
            came = name in route.sources or bool(route.feeders(name) & arrived)
            if route.injected and name in route.sources:
                states[name] = ComponentState.INJECTED
            elif name not in self._roles:
                states[name] = ComponentState.UNSEEN
            elif name not in left:
                states[name] = ComponentState.HELD
            elif left[name] <= moved:
                states[name] = ComponentState.REACHED if name in shown else ComponentState.PASSED
            else:
                back = self._fed_back(route.fed.get(name, ()), left)
                along = min((left[f] for f in route.feeders(name) & arrived if f in left), default=inf)
                by_loop = not came or (back <= left[name] and back <= along)
                states[name] = ComponentState.FEEDBACK if by_loop else ComponentState.REACHED
            if states[name] in _CAME or (states[name] is ComponentState.UNSEEN and came):
                arrived.add(name)
        return states, arrived

    def _moved(self, left: Mapping[str, float]) -> float:
        """Return the rank of the time at which the process left golden; infinite if it did not."""
        return min((left[name] for name in self.processes if name in left), default=inf)

    def _latest(self, route: PossibleRoute, left: Mapping[str, float]) -> dict[str, float]:
        """Return the rank of the time by which each component left golden.

        If a component is the only one that feeds another, it left golden no later than the other did, unless
        feedback could have reached the other. If the place of injection is unknown, nothing is inferred.
        """
        moved, times = self._moved(left), dict(left)
        for name in reversed(route.components if route.injected else ()):
            only = route.feeders(name) | route.fed.get(name, frozenset())
            if name in times and len(only) == 1 and name not in route.sources:
                (feeder,) = only
                if feeder in left or times[name] <= moved:
                    times[feeder] = min(times.get(feeder, inf), times[name])
        return times

    def _route_of(self, injected: frozenset[str]) -> PossibleRoute:
        if self.structure is None:
            return chained(self._roles, self.processes)
        return structured(self.structure.components, self._links, self.processes, injected)

    def _fed_back(self, names: Collection[str], left: Mapping[str, float]) -> float:
        """Return the rank of the earliest time of feedback through one of these components, or infinity.

        A recorded component feeds back once it has left golden, an unrecorded one once a component that leads
        to it has left golden.
        """
        unseen = steps_from([name for name in names if name not in self._roles], self._back).keys()
        return min((left[name] for name in {*names, *unseen} if name in left), default=inf)


def fault_paths_of(folder: RunFolder) -> FaultPaths | None:
    """Return the fault paths of a run's target, from run.json. None if no channel names a component."""
    head = folder.head
    if not any(channel.component for channel in head.channels):
        return None
    try:
        structure = StructureModel.model_validate(head.structure) if head.structure else None
    except ValueError:
        raise MutatorError("damaged at 'structure'", where=folder.path / HEAD, remedy=REMEDY) from None
    return FaultPaths(head.channels, structure)


_CHANGED = (ComponentState.REACHED, ComponentState.PASSED, ComponentState.FEEDBACK)
_CAME = (ComponentState.INJECTED, ComponentState.REACHED, ComponentState.PASSED)


def _sooner(some: Mapping[str, float], others: Mapping[str, float], name: str) -> float | None:
    return some[name] if some.get(name, inf) < others.get(name, inf) else None


def _link_state(
    tail: str, tip: str, states: Mapping[str, ComponentState], arrived: Collection[str]
) -> LinkState:
    if tail not in arrived or states[tip] is ComponentState.INJECTED:
        return LinkState.NONE
    if states[tip] is ComponentState.UNSEEN:
        return LinkState.UNKNOWN
    return LinkState.THROUGH if states[tip] in _CAME else LinkState.STOPPED


def _holding(
    route: PossibleRoute, states: Mapping[str, ComponentState], arrived: Collection[str]
) -> tuple[str, ...]:
    """Return the components that held a fault: those fed by a component that the fault reached or, if there
    are none, the first ones on its path.
    """
    held = [name for name in route.components if states[name] is ComponentState.HELD]
    reached = {name for name in route.components if states[name] is ComponentState.REACHED}
    after_reached = [name for name in held if route.feeders(name) & reached]
    return tuple(after_reached or (n for n in held if n in route.sources or route.feeders(n) & {*arrived}))
