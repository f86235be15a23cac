"""Find the components on a fault's route to the controlled process, in causal order."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from mutator.stpa.analysis_files import Kind, StructureModel
from mutator.targets.channels import Role


@dataclass(frozen=True, slots=True, kw_only=True)
class PossibleRoute:
    """The route that faults in some components can take: the components in causal order, and their links."""

    components: tuple[str, ...]
    links: Mapping[str, tuple[str, str]]
    sources: frozenset[str]  # components at which the fault enters
    injected: bool  # whether the sources are known to be the place of injection
    fed: Mapping[str, frozenset[str]]  # by component: the components not on the route that lead to it
    steps: Mapping[str, int]  # by component: number of links to the process

    def feeders(self, component: str) -> set[str]:
        return {tail for tail, tip in self.links.values() if tip == component}


def chained(roles: Mapping[str, str], processes: frozenset[str]) -> PossibleRoute:
    """Return the chain of components, ordered by their channels' roles. The place of injection is unknown."""
    order = [role.value for role in (Role.INTERNAL, Role.ACTUATOR, Role.TRUTH)]
    chain = sorted(roles, key=lambda name: order.index(roles[name]))
    links = {f"{tail}-{tip}": (tail, tip) for tail, tip in pairwise(chain)}
    # the process can also feed back into the first component
    return PossibleRoute(
        components=tuple(chain),
        links=links,
        sources=frozenset(chain[:1]),
        injected=False,
        fed=dict.fromkeys(chain[:1], processes),
        steps={name: len(chain) - place for place, name in enumerate(chain)},
    )


def structured(
    components: Collection[str],
    links: Mapping[str, tuple[str, str]],
    processes: frozenset[str],
    injected: frozenset[str],
) -> PossibleRoute:
    """Return the route from the injected components along `links`, without links out of a process."""
    forward = {name: ends for name, ends in links.items() if ends[0] not in processes}
    steps = steps_from(processes, [(tip, tail) for tail, tip in forward.values()])
    on_route = (steps_from(injected, forward.values()).keys() & steps.keys()) | injected
    own = {name: pair for name, pair in forward.items() if on_route.issuperset(pair)}
    fed = {
        name: frozenset(tail for tail, tip in links.values() if tip == name and tail not in on_route)
        for name in on_route
    }
    return PossibleRoute(
        components=_in_causal_order([name for name in components if name in on_route], own, steps),
        links=own,
        sources=injected,
        injected=True,
        fed=fed,
        steps={name: steps.get(name, len(on_route)) for name in on_route},
    )


def links_of(structure: StructureModel) -> dict[str, tuple[str, str]]:
    """Return the ends of each studied link that does not involve people."""
    people = {name for name, one in structure.components.items() if one.kind is Kind.HUMAN}
    ends = ((name, (link.from_, link.to)) for name, link in structure.links.items() if link.studied)
    return {name: pair for name, pair in ends if not people.intersection(pair)}


def steps_from(start: Collection[str], links: Collection[tuple[str, str]]) -> dict[str, int]:
    """Return the distance from `start`, in links, of everything that is reachable, including `start`."""
    found = dict.fromkeys(start, 0)
    while more := {tip for tail, tip in links if tail in found} - found.keys():
        found |= dict.fromkeys(more, max(found.values()) + 1)
    return found


def _in_causal_order(
    nodes: Sequence[str], links: Mapping[str, tuple[str, str]], steps: Mapping[str, int]
) -> tuple[str, ...]:
    """Sort the nodes so that each follows all nodes that feed it.

    If several nodes can come next, or none because of a cycle, the one with the most `steps` to the process
    comes next.
    """
    left = sorted(nodes, key=lambda name: -steps.get(name, len(nodes)))
    order: list[str] = []
    while left:
        waiting = {tip for tail, tip in links.values() if tail in left and tail != tip}
        chosen = next((name for name in left if name not in waiting), left[0])
        left.remove(chosen)
        order.append(chosen)
    return tuple(order)
