"""Fault specs are read and expanded with a seed."""

from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.faults.draw_specs import DrawSpec
from mutator.faults.fault_specs import load_spec
from mutator.faults.spec_expansion import draw_values
from mutator.model import Fault, Hold
from mutator.workspace import Workspace
from tests.costs import is_cheap
from tests.unit.mutator.faults.toy_faults import SPEC_NAME, faults


def of(expanded: tuple[Fault, ...], variant: str) -> list[Fault]:
    return [fault for fault in expanded if fault.spec == f"{SPEC_NAME}/{variant}"]


def test_a_spec_keeps_the_order_of_its_variants(toy: Workspace) -> None:
    spec = toy.spec(SPEC_NAME)
    assert [v.name for v in spec] == ["longer", "silent", "both"]
    assert [v.fault_count for v in spec] == [3, 1, 2]
    assert spec.fault_count == 6 == len(faults(toy))
    assert spec.path == toy.library / "faults" / "sensor" / "distance.yaml"


def test_expansion_draws_one_value_from_each_range(toy: Workspace) -> None:
    longer = of(faults(toy), "longer")
    assert [f.value // 10 for f in longer] == [1, 2, 3]
    assert all(isinstance(f.value, int) and f.unit == "m" and f.aim == "H1" for f in longer)
    assert [dict(f.injections[0].params) for f in longer] == [
        {"by": float(f.value), "target": "gap"} for f in longer
    ]


@pytest.mark.parametrize(("model", "seed_count"), [("noise", 1), ("image_effect", 3)])
def test_neighbouring_values_meet_the_same_noise(toy: Workspace, model: str, seed_count: int) -> None:
    """The seed of noise depends on the variant, not on a value's number; image effects keep theirs."""
    effect = "{amount_m: error, effect: toycar.sensor.Sensor, camera: gap, scene: gap}"
    params = "{std_m: error}" if model == "noise" else effect
    path = toy.library / "faults" / "sensor" / "distance.yaml"
    text = path.read_text().replace("model: offset\n", f"model: {model}\n", 1)
    path.write_text(text.replace("params: {by_m: error}", f"params: {params}", 1))
    longer = of(faults(toy), "longer")
    assert len(longer) == 3
    assert len({dict(f.injections[0].params)["seed"] for f in longer}) == seed_count
    both = (*longer, *of(faults(toy, seed=4), "longer"))
    assert len({dict(f.injections[0].params)["seed"] for f in both}) == 2 * seed_count


def test_values_are_converted_to_the_variables_unit(toy: Workspace) -> None:
    for fault in of(faults(toy), "both"):
        by = dict(fault.injections[1].params)["by"]
        assert by == pytest.approx(-float(fault.value) / 3.6)
        assert fault.unit == "km/h"
        assert fault.value == round(float(fault.value), 1)


def test_both_readings_share_their_draws(toy: Workspace) -> None:
    described, coded = faults(toy), faults(toy, reading="as_coded")
    assert [f.value for f in described] == [f.value for f in coded]
    assert all(f.reading == "as_coded" for f in coded)
    for fault in of(coded, "both"):
        assert dict(fault.injections[1].params)["by"] == -float(fault.value)
    assert of(coded, "longer")[0].injections == of(described, "longer")[0].injections


def test_a_fault_has_the_hold_and_the_changes_of_its_variant(toy: Workspace) -> None:
    (silent,) = of(faults(toy), "silent")
    assert silent.hold is Hold.TO_END
    assert silent.changes == ("alone",)
    assert (silent.value, silent.unit) == (None, "-")


def test_a_reading_can_override_the_hold(toy: Workspace) -> None:
    path = toy.spec(SPEC_NAME).path
    text = path.read_text()
    both = text.index("as_coded:", text.index("both:"))
    path.write_text(text[:both] + text[both:].replace("as_coded:", "as_coded:\n      hold: to_end", 1))
    workspace = Workspace(library=toy.library, templates=toy.templates)
    assert {fault.hold for fault in of(faults(workspace), "both")} == {None}
    assert {fault.hold for fault in of(faults(workspace, reading="as_coded"), "both")} == {Hold.TO_END}
    assert {fault.hold for fault in of(faults(workspace, reading="as_coded"), "silent")} == {Hold.TO_END}


def test_ids_depend_on_the_seed_and_are_unique(toy: Workspace) -> None:
    again = [f.id for f in faults(toy)]
    assert again == [f.id for f in faults(toy)]
    assert len(set(again)) == 6
    other = [f.id for f in faults(toy, seed=4)]
    assert other != again and other[3] == again[3], "only the fault without a value stays the same"


def test_drawn_values_depend_on_the_key_and_do_not_exceed_the_cap() -> None:
    ranges = tuple((float(i), float(i + 9)) for i in range(10, 70, 10))
    draw = DrawSpec(key="k", name="speed", unit="mph", kind="integers", ranges=ranges, cap=60)
    same = DrawSpec(key="k", name="fast", unit="mph", kind="integers", ranges=ranges, cap=60)
    other = DrawSpec(key="l", name="speed", unit="mph", kind="integers", ranges=ranges, cap=60)
    assert draw_values(draw, 1)[-1] == 60
    assert draw_values(draw, 1) == draw_values(same, 1)
    assert {draw_values(draw, i) == draw_values(other, i) for i in range(20)} == {False}


@pytest.mark.parametrize(
    ("written", "value"),
    [("true", True), ("null", None), ("far", "far"), ("'12'", "12"), ("'it''s #1'", "it's #1")],
)
@pytest.mark.parametrize("unit", ["          unit: m\n", ""])
def test_a_variable_can_be_stuck_at_a_value_without_a_unit(
    toy: Workspace, unit: str, written: str, value: object
) -> None:
    path = toy.library / "faults" / "sensor" / "distance.yaml"
    old = "model: offset\n          unit: m\n          params: {by_m: error}"
    assert old in path.read_text()
    path.write_text(
        path.read_text().replace(old, f"model: stuck\n{unit}          params: {{value: {written}}}")
    )
    assert dict(of(faults(toy), "longer")[0].injections[0].params) == {"target": "gap", "value": value}


def test_a_parameter_can_name_the_drawn_value(toy: Workspace) -> None:
    path = toy.library / "faults" / "sensor" / "distance.yaml"
    text = path.read_text().replace("model: offset", "model: stuck", 1)
    path.write_text(text.replace("by_m: error", "value_m: -error", 1))
    for fault in of(faults(toy), "longer"):
        assert dict(fault.injections[0].params) == {"target": "gap", "value": -float(fault.value)}  # type: ignore[arg-type]


PAIRS = """\
schema: fault_spec/1
module: sensor
fault_type: distance
about: A wrong gap and a wrong speed.
variants:
  pair:
    about: Two values that belong together.
    draw:
      error_m: {values: [3, 1, 2]}
      haste_kph: {values: [36, 72, 18]}
    as_described:
      injections:
        - at: {file: toycar/sensor.py, function: Sensor.measure, after_assign: gap}
          model: offset
          unit: m
          params: {by_m: error}
        - at: {file: toycar/sensor.py, function: Sensor.measure, after_assign: gap}
          model: offset
          unit: mps
          params: {by_kph: -haste}
"""

SINGLE_IDS = ["61bb454f23101d6a", "73869449aab2bac0", "72598b972ca98ad3"]  # of the first list alone


def paired(workspace: Workspace, old: str = "", new: str = "") -> Path:
    path = workspace.library / "faults" / "sensor" / "distance.yaml"
    path.write_text(PAIRS.replace(old, new))
    return path


def test_the_nth_values_of_several_lists_make_one_fault(toy: Workspace) -> None:
    """The first value names the fault; each injection gets its own, in the unit of its variable."""
    paired(toy)
    paired_faults = faults(toy)
    assert [(f.value, f.unit) for f in paired_faults] == [(3, "m"), (1, "m"), (2, "m")]
    assert [[dict(i.params)["by"] for i in f.injections] for f in paired_faults] == [
        [3, -10],
        [1, -20],
        [2, -5],
    ]
    assert len({f.id for f in paired_faults}) == 3


def test_a_list_alone_makes_the_faults_that_it_made_before_lists_could_be_paired(toy: Workspace) -> None:
    path = paired(toy, "      haste_kph: {values: [36, 72, 18]}\n", "")
    path.write_text(path.read_text().replace("by_kph: -haste", "by_mps: 1"))
    assert [f.id for f in faults(toy)] == SINGLE_IDS


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[36, 72, 18]", "[36, 72]", "10: 2 values; expected 3, as many as in `error_m`"),
        ("[3, 1, 2]", "[3, 1, 3]", "9: 3 twice; expected different values in the first of several lists"),
        ("haste_kph: {values", "error_kph: {values", "'error' twice; expected draws with different names"),
        ("-haste", "-hast", "'-hast' for 'by_kph'; expected a number, or 'error' or 'haste', the draws"),
        (
            "\n      error_m: {values: [3, 1, 2]}\n      haste_kph: {values: [36, 72, 18]}",
            " {}",
            "8: no draw; expected at least one",
        ),
    ],
)
def test_lists_that_are_no_pairs_are_refused(toy: Workspace, old: str, new: str, message: str) -> None:
    path = paired(toy, old, new)
    with pytest.raises(MutatorError) as caught:
        faults(toy)
    assert message in str(caught.value).replace(f"{path}:", "")


def test_a_spec_outside_the_library_is_loaded_by_path(tmp_path: Path, toy: Workspace) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text((toy.library / "faults" / "sensor" / "distance.yaml").read_text())
    assert load_spec(path, toy.readings()).fault_count == toy.spec(path).fault_count == 6


def test_an_unknown_reading_is_refused(toy: Workspace) -> None:
    with pytest.raises(MutatorError, match="reading 'as_built'; expected one of as_described, as_coded"):
        faults(toy, reading="as_built")


def test_ranges_with_too_few_different_values_are_not_drawn_again_for_ever() -> None:
    ranges = tuple((5.0 + i, 6.0 + i) for i in range(1000))
    is_cheap(
        lambda: draw_values(DrawSpec(key="k", name="n", unit=None, kind="integers", ranges=ranges, cap=1), 1)
    )
