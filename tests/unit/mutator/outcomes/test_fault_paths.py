"""The paths of faults through a structure with two controllers, and through chains of components without a
structure."""

import json
from pathlib import Path as Folder
from typing import Any

import pytest

from mutator._common.typed_json import typed_value_from_json
from mutator.errors import MutatorError
from mutator.model import (
    Anchor,
    AnchorKind,
    Experiment,
    Fault,
    FaultLocation,
    Injection,
    Method,
    ObservedActivation,
    Outcome,
    Record,
    Status,
    Trigger,
)
from mutator.outcomes.fault_paths import ComponentState, FaultPath, FaultPathFinder, LinkState, fault_paths_of
from mutator.store.run_folder import RunFolder
from mutator.stpa.hazard_analysis_yaml import ControlStructureModel
from mutator.targets.stored_target_facts import ChannelFacts
from tests.made_head import made_head

# eyes -> finder -> speed -> pedals -> car, and gauge -> wheel -> rack -> car; the gauge also feeds `speed`
KINDS = {
    "driver": "human",
    "speed": "controller",
    "wheel": "controller",
    "pedals": "actuator",
    "rack": "actuator",
    "finder": "estimator",
    "eyes": "sensor",
    "gauge": "sensor",
    "car": "process",
}
LINKS = {
    "orders": ("driver", "speed"),
    "light": ("car", "eyes"),
    "motion": ("car", "gauge"),
    "picture": ("eyes", "finder"),
    "lead": ("finder", "speed"),
    "pace": ("gauge", "speed"),
    "angle": ("gauge", "wheel"),
    "gas": ("speed", "pedals"),
    "torque": ("wheel", "rack"),
    "force": ("pedals", "car"),
    "turn": ("rack", "car"),
    "show": ("speed", "driver"),
}
STRUCTURE = ControlStructureModel.model_validate(
    {
        "about": "",
        "components": {
            name: {"kind": kind, "label": name, "about": "", "modules": [f"{name}.py"], "drawn": [i, 0, 1]}
            for i, (name, kind) in enumerate(KINDS.items())
        },
        "control_actions": {},
        "links": {name: {"from": tail, "to": tip, "label": ""} for name, (tail, tip) in LINKS.items()},
    }
)
CHANNELS = [
    typed_value_from_json(ChannelFacts, ["seen", "m", "internal", "finder", ""]),
    typed_value_from_json(ChannelFacts, ["wanted", "m/s", "internal", "speed", ""]),
    typed_value_from_json(ChannelFacts, ["angle", "rad", "internal", "wheel", ""]),
    typed_value_from_json(ChannelFacts, ["gas", "-", "actuator", "pedals", ""]),
    typed_value_from_json(ChannelFacts, ["torque", "-", "actuator", "rack", ""]),
    typed_value_from_json(ChannelFacts, ["place", "m", "truth", "car", ""]),
]
WAYS = FaultPathFinder(CHANNELS, STRUCTURE)


def experiment(*modules: str) -> Experiment:
    places = [
        FaultLocation(path=f"{m}.py", function="f", anchor=Anchor(kind=AnchorKind.ENTRY)) for m in modules
    ]
    fault = Fault(
        spec="a/b/c",
        module="a",
        fault_type="b",
        reading="r",
        value=1,
        unit="-",
        aim="",
        injections=tuple(Injection(location=place, model="offset") for place in places),
    )
    trigger = Trigger(name="t", condition="t >= 1")
    return Experiment(
        fault=fault, scenario="S", scenario_digest="", method=Method.RANDOM, trigger=trigger, seed=1
    )


def record(outcome: Outcome | None, **left: float) -> Record:
    return Record(
        experiment_id="",
        status=Status.OK if outcome else Status.CRASHED,
        outcome=outcome,
        detail="",
        tree="",
        activation=ObservedActivation(first=1.0, last=1.0, count=1),
        t_manifest=None,
        max_dev=(),
        hazards=(),
        alerts=(),
        trace_digest="",
        left=tuple((name, t, 1.0) for name, t in left.items()),
    )


def path(
    *modules: str, outcome: Outcome = Outcome.SDC, fault_paths: FaultPathFinder = WAYS, **left: float
) -> FaultPath:
    found = fault_paths.fault_path(experiment(*modules), record(outcome, **left))
    assert found is not None
    return found


def states(found: FaultPath) -> dict[str, ComponentState]:
    return {one.name: one.state for one in found.components}


def link_states(found: FaultPath) -> dict[str, LinkState]:
    return {link.name: link.state for link in found.links}


@pytest.mark.parametrize("pattern", ["a/b", "a/b/c", "a/*", "*/c"])
def test_the_path_of_a_fault_begins_at_the_component_that_names_it(pattern: str) -> None:
    """A sensor's fault that is injected where the estimator reads it can be stopped by the estimator."""
    eyes = STRUCTURE.components["eyes"].model_copy(update={"faults": [pattern]})
    structure = STRUCTURE.model_copy(update={"components": STRUCTURE.components | {"eyes": eyes}})
    found = path("finder", outcome=Outcome.MASKED, fault_paths=FaultPathFinder(CHANNELS, structure))
    assert (found.injected, found.stopped_at) == (("eyes",), ("finder",))


def test_a_component_that_names_another_fault_does_not_begin_its_path() -> None:
    eyes = STRUCTURE.components["eyes"].model_copy(update={"faults": ["a/b/d", "b"]})
    structure = STRUCTURE.model_copy(update={"components": STRUCTURE.components | {"eyes": eyes}})
    assert path("finder", fault_paths=FaultPathFinder(CHANNELS, structure)).injected == ("finder",)


def test_an_estimator_that_did_not_change_stopped_the_fault() -> None:
    found = path("eyes", outcome=Outcome.MASKED)
    assert [*states(found).items()] == [
        ("eyes", ComponentState.INJECTED),
        ("finder", ComponentState.UNCHANGED),
        ("speed", ComponentState.UNCHANGED),
        ("pedals", ComponentState.UNCHANGED),
        ("car", ComponentState.UNCHANGED),
    ]
    assert (found.reached, found.stopped_at) == ("", ("finder",))
    assert link_states(found) == {
        "picture": LinkState.STOPPED,
        "lead": LinkState.NOT_REACHED,
        "gas": LinkState.NOT_REACHED,
        "force": LinkState.NOT_REACHED,
    }


def test_a_controller_that_did_not_change_stopped_the_fault() -> None:
    found = path("eyes", outcome=Outcome.MASKED, seen=1.2)
    assert (found.reached, found.stopped_at) == ("finder", ("speed",))
    assert link_states(found)["picture"] is LinkState.THROUGH
    assert link_states(found)["lead"] is LinkState.STOPPED


def test_a_fault_that_changed_the_car_reached_it() -> None:
    found = path("eyes", seen=1.2, wanted=1.3, gas=1.3, place=1.4)
    assert [(s.name, s.t_first) for s in found.components[1:]] == [
        ("finder", 1.2),
        ("speed", 1.3),
        ("pedals", 1.3),
        ("car", 1.4),
    ]
    assert {*link_states(found).values()} == {LinkState.THROUGH}
    assert (found.reached, found.stopped_at) == ("car", ())


def test_feedback_is_not_part_of_the_path() -> None:
    """A car that moves differently is also observed differently."""
    found = path("wheel", angle=1.0, torque=1.0, place=1.1, seen=1.2, wanted=1.3, gas=1.4)
    assert states(found) == {
        "wheel": ComponentState.INJECTED,
        "rack": ComponentState.REACHED,
        "car": ComponentState.REACHED,
    }


def test_links_that_the_study_ignores_are_not_part_of_the_path() -> None:
    ends = {"from": "speed", "to": "wheel", "label": ""}
    links = {name: {"from": tail, "to": tip, "label": ""} for name, (tail, tip) in LINKS.items()}
    for studied, names in ((True, {"wheel", "rack"}), (False, set())):
        structure = replace_links({**links, "engaged": {**ends, "studied": studied}})
        found = states(path("speed", fault_paths=FaultPathFinder(CHANNELS, structure), wanted=1.1, gas=1.1))
        assert found.keys() - {"speed", "pedals", "car"} == names


def test_a_component_that_changed_after_the_car_only_received_feedback() -> None:
    """The speed control changed after the car and has an input that is not on the path."""
    found = path("finder", "wheel", angle=1.0, torque=1.0, place=1.1, wanted=1.5, gas=1.6)
    assert states(found) == {
        "finder": ComponentState.INJECTED,
        "wheel": ComponentState.INJECTED,
        "rack": ComponentState.REACHED,
        "speed": ComponentState.FEEDBACK,
        "pedals": ComponentState.FEEDBACK,
        "car": ComponentState.REACHED,
    }
    assert link_states(found)["lead"] is LinkState.STOPPED
    assert link_states(found)["gas"] is LinkState.NOT_REACHED


def test_the_only_input_of_a_reached_component_passed_the_fault_on() -> None:
    """The rack changed before the car, and the wheel control is the rack's only input."""
    found = path("gauge", torque=1.0, place=1.1)
    assert states(found)["wheel"] is ComponentState.PASSED
    assert link_states(found)["angle"] is link_states(found)["torque"] is LinkState.THROUGH
    assert states(path("gauge", torque=1.0, place=1.1, angle=1.2))["wheel"] is ComponentState.REACHED


def test_a_component_changed_no_later_than_those_that_it_alone_feeds() -> None:
    """Only the speed control feeds the pedals."""
    found = path("finder", gas=1.2, place=1.3, wanted=1.25)
    assert {s.name: s.t_changed_by for s in found.components if s.t_changed_by is not None} == {"speed": 1.2}
    assert [s.t_first for s in found.components if s.name == "speed"] == [1.25]
    late = path("eyes", "wheel", torque=1.0, place=1.1, gas=1.2, wanted=1.5)
    assert {s.name: s.t_changed_by for s in late.components if s.t_changed_by is not None} == {"speed": 1.2}


@pytest.mark.parametrize(
    ("left", "state"),
    [
        ({"pace": 1.6}, ComponentState.REACHED),  # the gauge had not yet observed the car's different motion
        ({"pace": 1.5}, ComponentState.FEEDBACK),
        ({"pace": 1.5, "seen": 1.2}, ComponentState.REACHED),  # the fault reached it earlier
        ({"pace": 1.2, "seen": 1.4}, ComponentState.FEEDBACK),
    ],
)
def test_the_first_changed_input_decides_between_fault_and_feedback(
    left: dict[str, float], state: ComponentState
) -> None:
    """The car moved differently before the speed control changed."""
    pace = typed_value_from_json(ChannelFacts, ["pace", "m/s", "internal", "gauge", ""])
    fault_paths = FaultPathFinder([*CHANNELS, pace], STRUCTURE)
    found = path("finder", "wheel", fault_paths=fault_paths, torque=1.0, place=1.1, wanted=1.5, **left)
    assert states(found)["speed"] is state


def test_a_component_with_a_single_input_is_reached_even_after_the_car() -> None:
    """Only the speed control feeds the pedals."""
    found = path("eyes", "wheel", seen=1.0, wanted=1.0, torque=1.0, place=1.1, gas=3.0)
    assert states(found)["pedals"] is ComponentState.REACHED


def test_components_without_channels_are_unobserved() -> None:
    fault_paths = FaultPathFinder([channel for channel in CHANNELS if channel.name != "seen"], STRUCTURE)
    found = path("eyes", fault_paths=fault_paths, wanted=1.2, gas=1.2, place=1.3)
    assert states(found)["finder"] is ComponentState.UNRECORDED
    assert link_states(found)["picture"] is LinkState.UNKNOWN
    assert link_states(found)["lead"] is LinkState.THROUGH
    held = path("eyes", fault_paths=fault_paths, outcome=Outcome.MASKED)
    assert held.stopped_at == ("speed",)


def test_two_controllers_can_stop_one_fault() -> None:
    assert path("gauge", outcome=Outcome.MASKED).stopped_at == ("speed", "wheel")
    assert path("gauge", outcome=Outcome.MASKED, angle=2.0).stopped_at == ("rack",)


@pytest.mark.parametrize("outcome", [Outcome.NOT_ACTIVATED, None])
def test_an_inactive_fault_or_a_failed_run_has_no_path(outcome: Outcome | None) -> None:
    assert WAYS.fault_path(experiment("eyes"), record(outcome)) is None


def test_a_fault_outside_all_components_has_no_path() -> None:
    """The start of the path is unknown."""
    assert WAYS.fault_path(experiment("other"), record(Outcome.SDC, gas=1.0)) is None


def test_without_a_structure_components_are_ordered_by_role() -> None:
    fault_paths = FaultPathFinder(CHANNELS[::-1], None)
    found = path("eyes", fault_paths=fault_paths, outcome=Outcome.MASKED, angle=1.0)
    assert [*states(found)] == ["wheel", "speed", "finder", "rack", "pedals", "car"]
    assert (found.reached, found.stopped_at) == ("wheel", ("speed",))
    none = path("eyes", fault_paths=fault_paths, outcome=Outcome.MASKED)
    assert (none.reached, none.stopped_at) == ("", ("wheel",))


def test_a_chain_has_feedback_too() -> None:
    """The fault is injected after the interface, whose channels change only after the car."""
    fault_paths = FaultPathFinder(
        [
            typed_value_from_json(ChannelFacts, ["seen", "", "internal", "interface", ""]),
            typed_value_from_json(ChannelFacts, ["ask", "", "actuator", "control", ""]),
            typed_value_from_json(ChannelFacts, ["gap", "", "truth", "car", ""]),
        ],
        None,
    )
    found = path("x", fault_paths=fault_paths, ask=1.0, gap=1.1, seen=1.2)
    assert states(found) == {
        "interface": ComponentState.FEEDBACK,
        "control": ComponentState.REACHED,
        "car": ComponentState.REACHED,
    }


def test_a_path_through_a_loop_has_each_component_once() -> None:
    links: dict[str, Any] = {name: one.model_dump(by_alias=True) for name, one in STRUCTURE.links.items()}
    links["back"] = {"from": "speed", "to": "finder", "label": ""}
    circle = replace_links(links)
    found = path(
        "eyes", fault_paths=FaultPathFinder(CHANNELS, circle), seen=1.0, wanted=1.0, gas=1.0, place=1.1
    )
    assert [one.name for one in found.components] == ["eyes", "finder", "speed", "pedals", "car"]
    assert found.reached == "car"


def replace_links(links: dict[str, Any]) -> ControlStructureModel:
    return ControlStructureModel.model_validate(
        STRUCTURE.model_dump(mode="json", by_alias=True) | {"links": links}
    )


def test_the_structure_is_read_from_run_json(tmp_path: Folder) -> None:
    """Without components, there are no paths."""

    def read(**changes: object) -> FaultPathFinder | None:
        (tmp_path / "run.json").write_text(json.dumps(made_head(**changes)))
        return fault_paths_of(RunFolder.open_unverified(tmp_path))

    structure = STRUCTURE.model_dump(mode="json", by_alias=True)
    found = read(channels=CHANNELS, structure=structure)
    assert found is not None and found.structure == STRUCTURE
    assert read() is None
    assert read(channels=[channel._replace(component="") for channel in CHANNELS]) is None
    structure["links"]["lead"]["to"] = 3
    with pytest.raises(MutatorError, match="structure"):
        read(channels=CHANNELS, structure=structure)
