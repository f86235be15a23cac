"""Find the components on a fault's route to the controlled process, in causal order."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from mutator.stpa.hazard_analysis_yaml import ComponentKind, ControlStructureModel
from mutator.targets.channels import Role


@dataclass(frozen=True, slots=True, kw_only=True)
class PossibleRoute:
    """The route that faults in some components can take: the components in causal order, and their links."""

    components: tuple[str, ...]
    links: Mapping[str, tuple[str, str]]
    entry_components: frozenset[str]  # components at which the fault enters
    is_injection_place_known: bool  # whether the sources are known to be the place of injection
    feeders_off_route: Mapping[
        str, frozenset[str]
    ]  # by component: the components not on the route that lead to it
    distance_to_process_by_component: Mapping[str, int]  # by component: number of links to the process

    def feeders_on_route(self, component: str) -> set[str]:
        return {tail for tail, tip in self.links.values() if tip == component}


def route_by_channel_roles(roles: Mapping[str, str], processes: frozenset[str]) -> PossibleRoute:
    """Return the chain of components, ordered by their channels' roles. The place of injection is unknown."""
    order = [role.value for role in (Role.INTERNAL, Role.ACTUATOR, Role.TRUTH)]
    chain = sorted(roles, key=lambda name: order.index(roles[name]))
    links = {f"{tail}-{tip}": (tail, tip) for tail, tip in pairwise(chain)}
    # the process can also feed back into the first component
    return PossibleRoute(
        components=tuple(chain),
        links=links,
        entry_components=frozenset(chain[:1]),
        is_injection_place_known=False,
        feeders_off_route=dict.fromkeys(chain[:1], processes),
        distance_to_process_by_component={name: len(chain) - place for place, name in enumerate(chain)},
    )


def route_through_structure(
    components: Collection[str],
    links: Mapping[str, tuple[str, str]],
    processes: frozenset[str],
    injected: frozenset[str],
) -> PossibleRoute:
    """Return the route from the injected components along `links`, without links out of a process."""
    forward = {name: ends for name, ends in links.items() if ends[0] not in processes}
    steps = distances_from(processes, [(tip, tail) for tail, tip in forward.values()])
    on_route = (distances_from(injected, forward.values()).keys() & steps.keys()) | injected
    route_links = {name: pair for name, pair in forward.items() if on_route.issuperset(pair)}
    off_route = {
        name: frozenset(tail for tail, tip in links.values() if tip == name and tail not in on_route)
        for name in on_route
    }
    return PossibleRoute(
        components=_in_causal_order([name for name in components if name in on_route], route_links, steps),
        links=route_links,
        entry_components=injected,
        is_injection_place_known=True,
        feeders_off_route=off_route,
        distance_to_process_by_component={name: steps.get(name, len(on_route)) for name in on_route},
    )


def studied_links(structure: ControlStructureModel) -> dict[str, tuple[str, str]]:
    """Return the ends of each studied link that does not involve people."""
    people = {
        name for name, component in structure.components.items() if component.kind is ComponentKind.HUMAN
    }
    ends = ((name, (link.from_, link.to)) for name, link in structure.links.items() if link.studied)
    return {name: pair for name, pair in ends if not people.intersection(pair)}


def distances_from(start: Collection[str], links: Collection[tuple[str, str]]) -> dict[str, int]:
    """Return the distance from `start`, in links, of everything that is reachable, including `start`."""
    distances = dict.fromkeys(start, 0)
    while next_components := {tip for tail, tip in links if tail in distances} - distances.keys():
        distances |= dict.fromkeys(next_components, max(distances.values()) + 1)
    return distances


def _in_causal_order(
    nodes: Sequence[str], links: Mapping[str, tuple[str, str]], steps: Mapping[str, int]
) -> tuple[str, ...]:
    """Sort the nodes so that each follows all nodes that feed it.

    If several nodes can come next, or none because of a cycle, the one with the most `steps` to the process
    comes next.
    """
    remaining = sorted(nodes, key=lambda name: -steps.get(name, len(nodes)))
    order: list[str] = []
    while remaining:
        waiting = {tip for tail, tip in links.values() if tail in remaining and tail != tip}
        chosen = next((name for name in remaining if name not in waiting), remaining[0])
        remaining.remove(chosen)
        order.append(chosen)
    return tuple(order)
