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
from mutator.outcomes.fault_routes_to_process import (
    PossibleRoute,
    distances_from,
    route_by_channel_roles,
    route_through_structure,
    studied_links,
)
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import DAMAGED_RUN_REMEDY, HEAD
from mutator.stpa.hazard_analysis_yaml import ComponentKind, ControlStructureModel
from mutator.targets.channels import Role
from mutator.targets.stored_target_facts import ChannelFacts


class ComponentState(StrEnum):
    """The effect of the fault at a component."""

    INJECTED = "injected"
    REACHED = "reached"  # one of its channels left golden
    PASSED = "passed"  # none of its channels left golden, but a component that only it feeds did
    FEEDBACK = "feedback"  # one of its channels left golden, but only after the process
    UNCHANGED = "held"  # it has channels, and none left golden
    UNRECORDED = "unseen"  # it has no recorded channels


class LinkState(StrEnum):
    """Whether the fault got through a link of its path."""

    THROUGH = "through"
    STOPPED = "stopped"
    UNKNOWN = "unknown"  # the end of the link is not recorded
    NOT_REACHED = "none"  # the fault did not reach the start of the link


@dataclass(frozen=True, slots=True, kw_only=True)
class PathComponent:
    """A component on a path, and its channels that left golden.

    If a component that only this one feeds left golden before this one's own channels did, `t_changed_by` is
    the time (s) when that happened: this component must have changed by then.
    """

    name: str
    state: ComponentState
    departures: tuple[Departure, ...]
    t_changed_by: float | None = None

    @property
    def t_first(self) -> float | None:
        return min((first for _, first, _ in self.departures), default=None)


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
    def state_by_component(self) -> Mapping[str, ComponentState]:
        return {component.name: component.state for component in self.components}

    @property
    def injected(self) -> tuple[str, ...]:
        return tuple(
            component.name for component in self.components if component.state is ComponentState.INJECTED
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class UntimedPath:
    """A path without times. Paths have the same untimed path if they have the same injected components, and
    components left golden in the same order.

    `inferred_ranks` has the components that must have changed before their own channels did, each with the
    rank of `PathComponent.t_changed_by` among all times. `link_to_first_actuator` is the link by which the
    fault reached the first actuator.
    """

    state_by_component: Mapping[str, ComponentState]  # in causal order
    inferred_ranks: Mapping[str, int]
    links: tuple[PathLink, ...]
    reached: str
    stopped_at: tuple[str, ...]
    link_to_first_actuator: PathLink | None

    @property
    def injected(self) -> tuple[str, ...]:
        return tuple(
            name for name, state in self.state_by_component.items() if state is ComponentState.INJECTED
        )


class UntimedPathInputs(NamedTuple):
    """The facts about an experiment that determine its untimed path."""

    injected: frozenset[str]
    departure_ranks: tuple[tuple[str, int], ...]  # the rank of the time at which each component left golden
    is_masked: bool


class FaultPathFinder:
    """The paths of faults through a target.

    Without a `structure`, the components form a chain: those of internal channels, then those of actuators,
    then those of ground truth. In a chain, the place of injection is unknown.
    """

    def __init__(self, channels: Sequence[ChannelFacts], structure: ControlStructureModel | None) -> None:
        self.component_by_channel = {channel.name: channel.component for channel in channels}
        self._role_by_component = {c.component: c.role for c in channels if c.component}
        self._actuators = {c.component for c in channels if c.role is Role.ACTUATOR}
        self.structure = structure
        self._links = studied_links(structure) if structure else {}
        # links from unrecorded components back to the components that feed them
        self._links_back = [
            (tip, tail) for tail, tip in self._links.values() if tip not in self._role_by_component
        ]
        # a million experiments have few different inputs
        self._cached_untimed_path = lru_cache(maxsize=None)(self._build_untimed_path)
        self._injected_by_fault: dict[str, frozenset[str]] = {}  # the components of each fault, by fault id

    @property
    def process_components(self) -> frozenset[str]:
        if self.structure is None:
            return frozenset(
                name for name, role in self._role_by_component.items() if role == Role.TRUTH.value
            )
        return frozenset(n for n, c in self.structure.components.items() if c.kind is ComponentKind.PROCESS)

    def _injected_components(self, fault: Fault) -> frozenset[str]:
        if fault.id not in self._injected_by_fault:
            files = {injection.location.path for injection in fault.injections}
            components = self.structure.components if self.structure else {}
            named = frozenset(name for name, c in components.items() if c.has_fault(fault.spec))
            self._injected_by_fault[fault.id] = named or frozenset(
                name for name, component in components.items() if files.intersection(component.modules)
            )
        return self._injected_by_fault[fault.id]

    def fault_path(self, experiment: Experiment, record: Record) -> FaultPath | None:
        """Return the path of an experiment.

        None if the fault was not active, if the run has no outcome, or if the fault is in no known component.
        """
        untimed_path = self.untimed_path(experiment.fault, record)
        if untimed_path is None:
            return None
        departures_by_component: dict[str, list[Departure]] = {}
        for departure in record.left:
            departures_by_component.setdefault(self.component_by_channel.get(departure[0], ""), []).append(
                departure
            )
        times = sorted({min(t for _, t, _ in departures) for departures in departures_by_component.values()})
        components = [
            PathComponent(
                name=name,
                state=state,
                departures=tuple(departures_by_component.get(name, ())),
                t_changed_by=times[untimed_path.inferred_ranks[name]]
                if name in untimed_path.inferred_ranks
                else None,
            )
            for name, state in untimed_path.state_by_component.items()
        ]
        return FaultPath(
            components=tuple(components),
            links=untimed_path.links,
            reached=untimed_path.reached,
            stopped_at=untimed_path.stopped_at,
        )

    def untimed_path(self, fault: Fault, record: Record) -> UntimedPath | None:
        """Return the untimed path of an experiment; None in the same cases as `fault_path`."""
        inputs = self.untimed_path_inputs(fault, record)
        return inputs and self.untimed_path_from(inputs)

    def untimed_path_from(self, inputs: UntimedPathInputs) -> UntimedPath | None:
        return self._cached_untimed_path(*inputs)

    def untimed_path_inputs(self, fault: Fault, record: Record) -> UntimedPathInputs | None:
        """Return the inputs of an untimed path; None if the fault was not active or without an outcome."""
        if record.outcome in (None, Outcome.NOT_ACTIVATED):
            return None
        firsts: dict[str, float] = {}
        for channel, first, _ in record.left:
            component = self.component_by_channel.get(channel, "")
            if first < firsts.get(component, inf):
                firsts[component] = first
        rank = {time: i for i, time in enumerate(sorted(set(firsts.values())))}
        order = tuple(sorted((name, rank[time]) for name, time in firsts.items()))
        return UntimedPathInputs(self._injected_components(fault), order, record.outcome is Outcome.MASKED)

    def _build_untimed_path(
        self, injected: frozenset[str], departure_ranks: tuple[tuple[str, int], ...], masked: bool
    ) -> UntimedPath | None:
        route = self._route_of(injected)
        if not route.components:
            return None
        ranks = dict(departure_ranks)
        latest_ranks = self._latest_ranks(route, ranks)
        states, arrived = self._component_states(route, ranks.keys(), latest_ranks)
        late = {
            name: _rank_if_earlier(latest_ranks, ranks, name)
            for name, state in states.items()
            if state in _CHANGED_STATES
        }
        changed = [
            n
            for n, state in states.items()
            if n in ranks and state in (ComponentState.INJECTED, ComponentState.REACHED)
        ]
        links = tuple(
            PathLink(name=name, tail=tail, tip=tip, state=_link_state(tail, tip, states, arrived))
            for name, (tail, tip) in route.links.items()
        )
        through = [c for c in links if c.tip in self._actuators and c.state is LinkState.THROUGH]
        return UntimedPath(
            state_by_component=states,
            inferred_ranks={name: int(place) for name, place in late.items() if place is not None},
            links=links,
            reached=min(
                reversed(changed), key=route.distance_to_process_by_component.__getitem__, default=""
            ),
            stopped_at=_stopping_components(route, states, arrived) if masked else (),
            link_to_first_actuator=min(through, key=lambda c: ranks.get(c.tip, inf), default=None),
        )

    def _component_states(
        self, route: PossibleRoute, departed: Collection[str], ranks: Mapping[str, float]
    ) -> tuple[dict[str, ComponentState], set[str]]:
        """Return the state of each component of a route, and the components that the fault reached.

        `ranks` has the rank of the time by which each component left golden. Components in `departed` have
        channels that left golden. The fault reaches an unrecorded component if it reached one that feeds it.
        """
        process_rank = self._process_rank(ranks)
        states: dict[str, ComponentState] = {}
        arrived: set[str] = set()
        for name in route.components:
            has_arrived = name in route.entry_components or bool(route.feeders_on_route(name) & arrived)
            if route.is_injection_place_known and name in route.entry_components:
                states[name] = ComponentState.INJECTED
            elif name not in self._role_by_component:
                states[name] = ComponentState.UNRECORDED
            elif name not in ranks:
                states[name] = ComponentState.UNCHANGED
            elif ranks[name] <= process_rank:
                states[name] = ComponentState.REACHED if name in departed else ComponentState.PASSED
            else:
                feedback_rank = self._earliest_feedback_rank(route.feeders_off_route.get(name, ()), ranks)
                forward_rank = min(
                    (ranks[f] for f in route.feeders_on_route(name) & arrived if f in ranks), default=inf
                )
                by_loop = not has_arrived or (feedback_rank <= ranks[name] and feedback_rank <= forward_rank)
                states[name] = ComponentState.FEEDBACK if by_loop else ComponentState.REACHED
            if states[name] in _STATES_REACHED_BY_FAULT or (
                states[name] is ComponentState.UNRECORDED and has_arrived
            ):
                arrived.add(name)
        return states, arrived

    def _process_rank(self, ranks: Mapping[str, float]) -> float:
        """Return the rank of the time at which the process left golden; infinite if it did not."""
        return min((ranks[name] for name in self.process_components if name in ranks), default=inf)

    def _latest_ranks(self, route: PossibleRoute, ranks: Mapping[str, float]) -> dict[str, float]:
        """Return the rank of the time by which each component left golden.

        If a component is the only one that feeds another, it left golden no later than the other did, unless
        feedback could have reached the other. If the place of injection is unknown, nothing is inferred.
        """
        process_rank, times = self._process_rank(ranks), dict(ranks)
        for name in reversed(route.components if route.is_injection_place_known else ()):
            feeders = route.feeders_on_route(name) | route.feeders_off_route.get(name, frozenset())
            if name in times and len(feeders) == 1 and name not in route.entry_components:
                (feeder,) = feeders
                if feeder in ranks or times[name] <= process_rank:
                    times[feeder] = min(times.get(feeder, inf), times[name])
        return times

    def _route_of(self, injected: frozenset[str]) -> PossibleRoute:
        if self.structure is None:
            return route_by_channel_roles(self._role_by_component, self.process_components)
        return route_through_structure(
            self.structure.components, self._links, self.process_components, injected
        )

    def _earliest_feedback_rank(self, names: Collection[str], ranks: Mapping[str, float]) -> float:
        """Return the rank of the earliest time of feedback through one of these components, or infinity.

        A recorded component feeds back once it has left golden, an unrecorded one once a component that leads
        to it has left golden.
        """
        behind_unrecorded = distances_from(
            [name for name in names if name not in self._role_by_component], self._links_back
        ).keys()
        return min((ranks[name] for name in {*names, *behind_unrecorded} if name in ranks), default=inf)


def fault_paths_of(folder: RunFolder) -> FaultPathFinder | None:
    """Return the fault paths of a run's target, from run.json. None if no channel names a component."""
    head = folder.head
    if not any(channel.component for channel in head.channels):
        return None
    try:
        structure = ControlStructureModel.model_validate(head.structure) if head.structure else None
    except ValueError:
        raise MutatorError(
            "damaged at 'structure'", where=folder.path / HEAD, remedy=DAMAGED_RUN_REMEDY
        ) from None
    return FaultPathFinder(head.channels, structure)


_CHANGED_STATES = (ComponentState.REACHED, ComponentState.PASSED, ComponentState.FEEDBACK)
_STATES_REACHED_BY_FAULT = (ComponentState.INJECTED, ComponentState.REACHED, ComponentState.PASSED)


def _rank_if_earlier(ranks: Mapping[str, float], other_ranks: Mapping[str, float], name: str) -> float | None:
    return ranks[name] if ranks.get(name, inf) < other_ranks.get(name, inf) else None


def _link_state(
    tail: str, tip: str, states: Mapping[str, ComponentState], arrived: Collection[str]
) -> LinkState:
    if tail not in arrived or states[tip] is ComponentState.INJECTED:
        return LinkState.NOT_REACHED
    if states[tip] is ComponentState.UNRECORDED:
        return LinkState.UNKNOWN
    return LinkState.THROUGH if states[tip] in _STATES_REACHED_BY_FAULT else LinkState.STOPPED


def _stopping_components(
    route: PossibleRoute, states: Mapping[str, ComponentState], arrived: Collection[str]
) -> tuple[str, ...]:
    """Return the components that held a fault: those fed by a component that the fault reached or, if there
    are none, the first ones on its path.
    """
    holding = [name for name in route.components if states[name] is ComponentState.UNCHANGED]
    reached = {name for name in route.components if states[name] is ComponentState.REACHED}
    after_reached = [name for name in holding if route.feeders_on_route(name) & reached]
    return tuple(
        after_reached
        or (n for n in holding if n in route.entry_components or route.feeders_on_route(n) & {*arrived})
    )
