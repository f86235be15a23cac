"""A report's data on fault paths."""

import re
from collections.abc import Callable
from dataclasses import replace
from math import inf

from mutator._common.typed_json import typed_value_from_json
from mutator.model import Record
from mutator.outcomes.fault_paths import (
    ComponentState,
    FaultPath,
    FaultPathFinder,
    LinkState,
    PathComponent,
    PathLink,
    UntimedPath,
)
from mutator.report.fault_path_drawing import counts_for_drawing, draw_path_counts, structure_with_paths
from mutator.report.fault_path_page_data import PathCounts, RunFaultPaths
from mutator.stpa.hazard_analysis_yaml import load_hazard_analysis
from mutator.targets.stored_target_facts import ChannelFacts
from mutator.workspace import Workspace

CHANNELS = [
    typed_value_from_json(ChannelFacts, ["seen", "m", "internal", "eyes", "what is seen"]),
    typed_value_from_json(ChannelFacts, ["gas", "-", "actuator", "pedals", ""]),
    typed_value_from_json(ChannelFacts, ["gap", "m", "truth", "car", ""]),
]


def path(*states: ComponentState, stopped_at: tuple[str, ...] = ()) -> FaultPath:
    names = ("eyes", "pedals", "car")
    components = tuple(
        PathComponent(name=n, state=s, departures=()) for n, s in zip(names, states, strict=True)
    )
    through = {
        ComponentState.REACHED: LinkState.THROUGH,
        ComponentState.UNCHANGED: LinkState.STOPPED,
        ComponentState.UNRECORDED: LinkState.UNKNOWN,
    }
    links = tuple(
        PathLink(name=f"{tail}-{tip}", tail=tail, tip=tip, state=through[state])
        for tail, tip, state in zip(names, names[1:], states[1:], strict=False)
    )
    return FaultPath(components=components, links=links, reached="", stopped_at=stopped_at)


def test_paths_become_shapes_and_columns_of_the_page(record: Callable[..., Record]) -> None:
    far, held = (
        path(*[ComponentState.REACHED] * 3),
        path(ComponentState.REACHED, ComponentState.UNCHANGED, ComponentState.UNCHANGED),
    )
    records = {
        "a": record("a", left=(("seen", 1.23456, 0.123456), ("gap", 2.0, inf))),
        "b": record("b"),
        "c": record("c", left=(("seen", 1.0, 2.0),)),
    }
    by_id = {"a": far, "c": held, "d": far}
    found = RunFaultPaths(
        fault_paths=FaultPathFinder(CHANNELS, None),
        channels=CHANNELS,
        path_by_experiment=by_id,
        records=records,
    )
    data = found.page_data(["a", "b", "c", "d"])
    assert data["shape"] == [0, -1, 1, 0]
    assert data["shapes"][0] == [["eyes", "reached", 0], ["pedals", "reached", 1], ["car", "reached", 2]]
    assert data["first"] == [[1.2346, None, 1.0, None], [None] * 4, [2.0, None, None, None]]
    assert data["largest"] == [[0.123, None, 2.0, None], [None] * 4, ["Infinity", None, None, None]]


def test_the_page_filters_by_the_links_that_a_fault_got_through() -> None:
    far, held = (
        path(*[ComponentState.REACHED] * 3),
        path(ComponentState.REACHED, ComponentState.UNCHANGED, ComponentState.UNCHANGED),
    )
    untimed_paths = [
        UntimedPath(
            state_by_component={},
            inferred_ranks={},
            links=one.links,
            reached="",
            stopped_at=(),
            link_to_first_actuator=None,
        )
        for one in (held, far)
    ]
    found = RunFaultPaths(
        fault_paths=FaultPathFinder(CHANNELS, None),
        channels=CHANNELS,
        path_by_experiment={},
        records={},
        distinct_untimed_paths=untimed_paths,
    )
    assert found.joined_passed_links([1, -1, 0]) == ["eyes→pedals;pedals→car", "", ""]


def test_faults_are_counted_by_link_and_component() -> None:
    """A fault is not counted for a link if the component after the link is not recorded."""
    counts = PathCounts()
    counts.add(path(ComponentState.INJECTED, ComponentState.REACHED, ComponentState.REACHED))
    counts.add(
        path(
            ComponentState.INJECTED,
            ComponentState.UNCHANGED,
            ComponentState.UNCHANGED,
            stopped_at=("pedals",),
        )
    )
    counts.add(path(ComponentState.INJECTED, ComponentState.UNRECORDED, ComponentState.REACHED))
    counts.add(path(ComponentState.INJECTED, ComponentState.REACHED, ComponentState.UNCHANGED))
    assert counts.active_fault_count == 4
    assert counts.passed_by_link == {"eyes-pedals": 2, "pedals-car": 2}
    assert counts.reached_by_link == {"eyes-pedals": 3, "pedals-car": 4}
    assert counts.entered_by_component == {"pedals": 2, "car": 2}
    assert (counts.injected_by_component, counts.stopped_by_component) == (
        {"eyes": 4},
        {"car": 2, "pedals": 1},
    )
    assert counts.masked_by_component == {"pedals": 1}
    assert counts.masked_by_component_set == {("pedals",): 1}


def test_components_that_a_fault_changed_by_none_of_the_links_are_counted() -> None:
    """The pedals change although the tracker, which feeds them, does not: the controller has disengaged. In a
    chain, where the place of injection is unknown, nothing is counted.
    """
    states = {
        "eyes": ComponentState.INJECTED,
        "tracker": ComponentState.UNCHANGED,
        "pedals": ComponentState.REACHED,
    }
    links = (
        PathLink(name="seen", tail="eyes", tip="tracker", state=LinkState.STOPPED),
        PathLink(name="lead", tail="tracker", tip="pedals", state=LinkState.NOT_REACHED),
    )
    known = UntimedPath(
        state_by_component=states,
        inferred_ranks={},
        links=links,
        reached="pedals",
        stopped_at=(),
        link_to_first_actuator=None,
    )
    counts = PathCounts()
    counts.add(known)
    counts.add(replace(known, state_by_component=states | {"eyes": ComponentState.UNCHANGED}))
    counts.add(path(ComponentState.INJECTED, ComponentState.REACHED, ComponentState.REACHED))
    assert counts.entered_otherwise_by_component == {"pedals": 1}


def test_the_drawing_of_other_counts_is_the_one_that_the_page_changes_to(clone: Workspace) -> None:
    """The script puts `drawn_counts` into the drawing of all faults."""
    structure = load_hazard_analysis(clone.library / "stpa").structure
    links, name = list(structure.links), next(iter(structure.components))
    counts = PathCounts(active_fault_count=8)
    counts.reached_by_link.update({links[0]: 8, links[1]: 3})
    counts.passed_by_link.update({links[0]: 1})
    counts.injected_by_component.update({name: 8})
    counts.masked_by_component.update({name: 2})
    drawn = counts_for_drawing(structure, counts, links)
    assert drawn["active"] == 8
    assert drawn["links"][links[0]] == ("through", "2.5px", "1 of 8, 12 %", "95 % interval 2 to 47 %")
    assert drawn["links"][links[1]] == ("stopped", "1.8px", "0 of 3, 0 %", "95 % interval 0 to 56 %")
    assert drawn["links"][links[2]] == ("quiet", "1.8px", "", "")
    assert drawn["components"][name] == ("box has-injected", "8 injected", "2 masked")
    figure = draw_path_counts(structure, counts, links)
    for kind, width, *_, interval in drawn["links"].values():
        assert f'class="link is-{kind}"' in figure and f"stroke-width: {width}" in figure
        assert f"\n{interval}</title>" in figure
    assert f'class="box has-injected" data-component="{name}"' in figure


def test_components_that_no_path_leads_to_are_not_drawn(clone: Workspace) -> None:
    """Links between the others stay, also those that no fault takes."""
    structure = load_hazard_analysis(clone.library / "stpa").structure
    name, link = next(iter(structure.links.items()))
    part = structure_with_paths(structure, [name])
    assert set(part.components) == {link.from_, link.to}
    assert name in part.links and {(x.from_, x.to) for x in part.links.values()} <= {
        (link.from_, link.to),
        (link.to, link.from_),
    }
    figure = draw_path_counts(part, PathCounts(), [name])
    assert set(re.findall(r'data-component="(\w+)"', figure)) == {link.from_, link.to}
