"""The possible values of a group, which do not depend on the seed, and their units."""

from dataclasses import replace

import pytest

from mutator.faults.spec_expansion import expand_spec
from mutator.model import Fault, Value
from mutator.review.parameter_ranges_and_units import units_of_parameters, value_ranges_of
from mutator.serve.served_trials import range_as_json
from mutator.workspace import Workspace


def faults(toy: Workspace, spec: str, seed: int = 0) -> list[Fault]:
    return list(expand_spec(toy.spec(spec), seed, models=toy.fault_models(), manifest=toy.manifest("toycar")))


def test_a_range_covers_all_ranges_of_the_specs(toycar: Workspace) -> None:
    specs, models = {spec.name: spec for spec in toycar.specs()}, toycar.fault_models()
    for seed in (0, 1):
        longer, nearer = (
            [one for one in faults(toycar, "sensor/distance", seed) if one.spec.endswith(name)]
            for name in ("longer", "nearer")
        )
        assert value_ranges_of(longer, specs, models) == {"by": (1.0, 65.0)}
        assert value_ranges_of(nearer[:1], specs, models) == {"by": (-459.0, -400.0), "low": (0.0, 0.0)}
        assert value_ranges_of(faults(toycar, "sensor/lane", seed)[:1], specs, models) == {"by": (0.0, 2.5)}


def test_without_a_spec_the_range_is_the_faults_value(toycar: Workspace) -> None:
    fault = faults(toycar, "sensor/distance")[0]
    assert value_ranges_of([fault], {}, toycar.fault_models()) == {"by": (fault.value, fault.value)}


@pytest.mark.parametrize(
    ("values", "found"),
    [
        ([3.0, -1.0], (-1.0, 3.0)),
        ([float("nan"), 3.0], (3.0, 3.0, "nan")),
        ([float("inf"), float("-inf")], ("-inf", "inf")),
        ([True, "word", None], None),  # these are part of the group's name
    ],
)
def test_values_without_an_order_are_listed_next_to_the_range(
    toycar: Workspace, values: list[Value], found: tuple[object, ...] | None
) -> None:
    fault = faults(toycar, "sensor/distance")[0]
    (injection,) = fault.injections
    made = [replace(fault, injections=(replace(injection, params=(("by", one),)),)) for one in values]
    assert value_ranges_of(made, {}, toycar.fault_models()).get("by") == found


def test_the_selected_execution_and_instance_are_values(toycar: Workspace) -> None:
    fault = faults(toycar, "sensor/distance")[0]
    (injection,) = fault.injections
    made = replace(fault, injections=(injection, replace(injection, call=3, where="index == 2")))
    found = value_ranges_of([made], {}, toycar.fault_models())
    assert set(found) == {"1.by", "2.by", "2.call", "2.where"}
    assert (found["2.call"], found["2.where"]) == ((3.0, 3.0), ("index == 2",))
    seeded = replace(injection, model="image_effect", params=(("amount", 2.0), ("seed", 9)))
    found = value_ranges_of([replace(fault, injections=(seeded,))], {}, toycar.fault_models())
    assert found == {"amount": (2.0, 2.0)}


def test_units_are_those_of_the_injected_code(toycar: Workspace) -> None:
    """A range of a parameter has the unit of the changed variable, if all specs agree on it."""
    specs, models = {spec.name: spec for spec in toycar.specs()}, toycar.fault_models()
    distance = faults(toycar, "sensor/distance")
    assert units_of_parameters(distance, specs, models) == {"by": "m", "low": "m", "high": "m"}
    assert units_of_parameters(distance, {}, models) == {}
    file = toycar.library / "faults/sensor/distance.yaml"
    file.write_text(file.read_text().replace("unit: m\n", "unit: cm\n", 1))
    disagreeing = {spec.name: spec for spec in toycar.specs()}
    assert units_of_parameters(distance, disagreeing, models) == {}


PAIRS = """\
schema: fault_spec/1
module: sensor
fault_type: pair
about: Two wrong values.
variants:
  both:
    about: Two values that belong together.
    draw:
      near_m: {values: [3, 1]}
      far_m: {values: [7, 9]}
    as_described:
      injections:
        - at: {file: toycar/sensing.py, function: Sensor.sense, after_assign: gap}
          model: offset
          unit: m
          params: {by_m: near}
        - at: {file: toycar/sensing.py, function: Sensor.sense, after_assign: gap}
          model: offset
          unit: m
          params: {by_m: -far}
"""


def test_values_in_pairs_have_a_range_each(toycar: Workspace) -> None:
    """The reviewer sees all values of both lists, also if a campaign takes only some of them."""
    (toycar.library / "faults" / "sensor" / "pair.yaml").write_text(PAIRS)
    specs, models = {spec.name: spec for spec in toycar.specs()}, toycar.fault_models()
    first = faults(toycar, "sensor/pair", 1)[:1]
    assert value_ranges_of(first, specs, models) == {"1.by": (1.0, 3.0), "2.by": (-9.0, -7.0)}


def test_values_in_pairs_cannot_be_chosen_on_a_slider(toycar: Workspace) -> None:
    (toycar.library / "faults" / "sensor" / "pair.yaml").write_text(PAIRS)
    (variant,) = toycar.spec("sensor/pair")
    assert range_as_json(variant) is None
