"""A report's data on fault paths."""

from collections.abc import Callable
from math import inf

from mutator.model import Record
from mutator.outcomes.fault_paths import (
    ComponentState,
    FaultPath,
    FaultPaths,
    LinkState,
    PathComponent,
    PathLink,
    UntimedPath,
)
from mutator.report.paths import PathCounts, RunPaths
from mutator.targets.target_facts import ChannelFacts

CHANNELS = [
    ChannelFacts.from_plain(["seen", "m", "internal", "eyes", "what is seen"]),
    ChannelFacts.from_plain(["gas", "-", "actuator", "pedals", ""]),
    ChannelFacts.from_plain(["gap", "m", "truth", "car", ""]),
]


def path(*states: ComponentState, stopped_at: tuple[str, ...] = ()) -> FaultPath:
    names = ("eyes", "pedals", "car")
    components = tuple(
        PathComponent(name=n, state=s, channels=()) for n, s in zip(names, states, strict=True)
    )
    through = {
        ComponentState.REACHED: LinkState.THROUGH,
        ComponentState.HELD: LinkState.STOPPED,
        ComponentState.UNSEEN: LinkState.UNKNOWN,
    }
    links = tuple(
        PathLink(name=f"{tail}-{tip}", tail=tail, tip=tip, state=through[state])
        for tail, tip, state in zip(names, names[1:], states[1:], strict=False)
    )
    return FaultPath(components=components, links=links, reached="", stopped_at=stopped_at)


def test_paths_become_shapes_and_columns_of_the_page(record: Callable[..., Record]) -> None:
    far, held = (
        path(*[ComponentState.REACHED] * 3),
        path(ComponentState.REACHED, ComponentState.HELD, ComponentState.HELD),
    )
    records = {
        "a": record("a", left=(("seen", 1.23456, 0.123456), ("gap", 2.0, inf))),
        "b": record("b"),
        "c": record("c", left=(("seen", 1.0, 2.0),)),
    }
    by_id = {"a": far, "c": held, "d": far}
    found = RunPaths(fault_paths=FaultPaths(CHANNELS, None), channels=CHANNELS, by_id=by_id, records=records)
    data = found.data(["a", "b", "c", "d"])
    assert data["shape"] == [0, -1, 1, 0]
    assert data["shapes"][0] == [["eyes", "reached", 0], ["pedals", "reached", 1], ["car", "reached", 2]]
    assert data["first"] == [[1.2346, None, 1.0, None], [None] * 4, [2.0, None, None, None]]
    assert data["largest"] == [[0.123, None, 2.0, None], [None] * 4, ["Infinity", None, None, None]]


def test_the_page_filters_by_the_links_that_a_fault_got_through() -> None:
    far, held = (
        path(*[ComponentState.REACHED] * 3),
        path(ComponentState.REACHED, ComponentState.HELD, ComponentState.HELD),
    )
    untimed_paths = [
        UntimedPath(states={}, late={}, links=one.links, reached="", stopped_at=(), entered=None)
        for one in (held, far)
    ]
    found = RunPaths(
        fault_paths=FaultPaths(CHANNELS, None),
        channels=CHANNELS,
        by_id={},
        records={},
        untimed_paths=untimed_paths,
    )
    assert found.through([1, -1, 0]) == ["eyes→pedals;pedals→car", "", ""]


def test_faults_are_counted_by_link_and_component() -> None:
    """A fault is not counted for a link if the component after the link is not recorded."""
    counts = PathCounts()
    counts.add(path(ComponentState.INJECTED, ComponentState.REACHED, ComponentState.REACHED))
    counts.add(
        path(ComponentState.INJECTED, ComponentState.HELD, ComponentState.HELD, stopped_at=("pedals",))
    )
    counts.add(path(ComponentState.INJECTED, ComponentState.UNSEEN, ComponentState.REACHED))
    counts.add(path(ComponentState.INJECTED, ComponentState.REACHED, ComponentState.HELD))
    plain = counts.plain()
    assert plain["active"] == 4
    assert plain["links"] == {"eyes-pedals": [2, 3], "pedals-car": [2, 4]}
    assert plain["components"] == {"eyes": [4, 0, 0], "car": [0, 2, 0], "pedals": [0, 1, 1]}
    assert counts.ends == {("pedals",): 1}
