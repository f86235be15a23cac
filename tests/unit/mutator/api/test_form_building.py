"""Which sizes a fault has, and the experiments of its forms."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

import mutator
from mutator import MutatorError
from mutator.api.form_building import FormBuilder
from mutator.api.target_and_fault_selection import SelectedTarget
from mutator.explore.fault_forms import FaultForm
from mutator.workspace import Workspace


def builder(workspace: Workspace, spec: str, value: float | None) -> FormBuilder:
    experiment = mutator.build_experiment(spec, "S3", 7.5, value=value, beyond=True, workspace=workspace)
    return FormBuilder(SelectedTarget.of(workspace), experiment)


def test_an_offset_is_smaller_nearer_to_0(clone: Workspace) -> None:
    """Whole numbers if the spec draws such, and down to a thousandth if it draws others; the sign stays."""
    speed = builder(clone, "car_sensors/speed/slower", 47).sizes
    angle = builder(clone, "car_sensors/steer/angle", -11.02).sizes
    assert speed and angle
    assert (speed.largest_size, speed.value(speed.largest_size), speed.numbers.step) == (47.0, 47.0, 1.0)
    assert (angle.largest_size, angle.value(2.5)) == (11.02, -2.5)
    assert angle.numbers.below(0.0121) == 0.012
    assert angle.numbers.below(0.012) is None


def test_listed_values_are_ordered_as_they_are_listed(clone: Workspace) -> None:
    """Less visibility is more fog, whatever the numbers say."""
    fog = builder(clone, "vision_weather/fog", 100).sizes
    assert fog
    assert fog.values == (800, 400, 200, 100)


def test_a_fault_without_a_value_has_no_size(clone: Workspace) -> None:
    """A lost camera is lost."""
    assert builder(clone, "vision_output/camera_unavailable/no_data", None).sizes is None


def test_a_form_is_an_experiment_that_differs_in_what_it_says(clone: Workspace) -> None:
    """Scenario, value, one injection, start and duration; seed, changes and all else stay."""
    original = builder(clone, "radar_vision/relative_distance/longer", 95)
    form = FaultForm(scenario="S1", injection=1, size=20.0, start_s=7.5, duration_s=0.05)
    built = original.build(form)
    assert built.scenario == "S1"
    assert built.scenario_digest != original.original.scenario_digest
    assert built.fault.value == 20
    assert len(built.fault.injections) == 1
    assert (built.trigger.name, built.trigger.hold_s) == ("at 7.5 s for 0.05 s", 0.05)
    assert (built.seed, built.changes) == (original.original.seed, original.original.changes)
    assert original.build(FaultForm(scenario="S3", size=95.0)) == original.original


def test_a_fault_that_the_library_no_longer_gives_is_refused(clone: Workspace) -> None:
    """Its smaller forms would be those of another fault. A fault of no library has no other sizes."""
    original = builder(clone, "radar_vision/relative_distance/longer", 95)
    original.check_spec_unchanged()
    edited = replace(original.original.fault, injections=original.original.fault.injections[:1])
    with pytest.raises(MutatorError, match="changed since the run"):
        replace(original, original=replace(original.original, fault=edited)).check_spec_unchanged()
    foreign = replace(original.original.fault, module="elsewhere")
    elsewhere = replace(original, original=replace(original.original, fault=foreign))
    elsewhere.check_spec_unchanged()
    assert elsewhere.sizes is None
    assert "no spec of this fault" in elsewhere.note


_PAIRED_SPEC = """\
schema: fault_spec/1
module: sensor
fault_type: pair
about: Two values are wrong.
variants:
  both:
    aim: H3
    about: Distance and offset.
    draw:
      gap_m: {values: [-1, 1, 2, 3, 4]}
      side_m: {values: [5, 5, -5, 6, 7]}
    as_described:
      injections:
        - at: {file: toycar/sensing.py, function: Sensor.sense, after_assign: gap}
          model: offset
          unit: m
          params: {by_m: gap}
        - at: {file: toycar/sensing.py, function: Sensor.sense, after_assign: offset}
          model: offset
          unit: m
          params: {by_m: side}
"""


def test_listed_values_with_another_sign_are_not_simpler(
    copy_toycar: Callable[[Path], Workspace], tmp_path: Path
) -> None:
    """An error to the other side is another one; of values in pairs, both keep their sign."""
    toycar = copy_toycar(tmp_path)
    (toycar.library / "faults/sensor/pair.yaml").write_text(_PAIRED_SPEC)
    experiment = mutator.build_experiment("sensor/pair/both", "A", 1.2, value=3, workspace=toycar)
    sizes = FormBuilder(SelectedTarget.of(toycar), experiment).sizes
    assert sizes
    assert sizes.values == (1, 3)
