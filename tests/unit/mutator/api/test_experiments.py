"""Experiments as a user asks for them."""

import pytest

import mutator
from mutator.campaigns.plan import build_plan
from mutator.errors import MutatorError
from mutator.model import AfterHazard, Hold, Trigger
from mutator.workspace import Workspace


def test_an_experiment_has_the_id_that_it_has_in_a_campaign(toycar: Workspace) -> None:
    """Content decides the id, so what a user builds and what a plan has are the same experiment."""
    planned = next(e for e in build_plan(toycar, "small").experiments if e.trigger.name == "near")
    built = mutator.build_experiment(planned.fault, "A", "near", seed=3, armed_after_s=1.0, workspace=toycar)
    assert built == planned and built.id == planned.id


def test_a_value_that_a_campaign_draws_keeps_its_number(clone: Workspace) -> None:
    """The seed of an image effect follows from the value's number, and a drawn 21.0 is not 21."""
    for variant, effects in (("vision_weather/rain/rate", True), ("car_sensors/steer/angle", False)):
        drawn = [fault for fault in clone.faults(variant.rpartition("/")[0], seed=3) if fault.spec == variant]
        assert {i.model == "image_effect" for fault in drawn for i in fault.injections} == {effects}
        for fault in drawn[:3]:
            built = mutator.build_experiment(variant, "S1", value=fault.value, seed=3, workspace=clone)
            assert built.fault == fault and built.fault.id == fault.id


def test_the_range_of_another_variant_does_not_matter(toycar: Workspace) -> None:
    """Without a variant, the first one is chosen, and only its range counts."""
    first, *others = toycar.spec("sensor/distance")
    assert others
    built = mutator.build_experiment(
        "sensor/distance", "A", value=first.draw.least_and_greatest[1], workspace=toycar
    )
    assert built.fault.spec == f"sensor/distance/{first.name}"


def test_a_value_beyond_the_declared_range_must_be_asked_for(toycar: Workspace) -> None:
    """A value outside the draw but in the range is accepted, one beyond the range only with `beyond`."""
    inside = mutator.build_experiment("sensor/distance/longer", "A", value=12.25, workspace=toycar)
    assert inside.fault.value == 12.25
    with pytest.raises(MutatorError, match=r"value 1000 is outside the range .* allow others with `beyond`"):
        mutator.build_experiment("sensor/distance/longer", "A", value=1000, workspace=toycar)
    beyond = mutator.build_experiment(
        "sensor/distance/longer", "A", value=1000, beyond=True, workspace=toycar
    )
    assert beyond.fault.value == 1000


def test_experiments_that_differ_only_in_the_hold_are_told_apart(toycar: Workspace) -> None:
    """The hold is in the id and in the name of the trigger."""
    built = [
        mutator.build_experiment("sensor/lane/shifted", "A", start, hold_s=hold, workspace=toycar)
        for start in (1.0, "near", "always", "d_rel < 20")
        for hold in (None, 0.5, 2)
    ]
    assert len({e.id for e in built}) == len({e.trigger.name for e in built}) == len(built)
    assert [e.trigger.name for e in built[:3]] == ["at 1 s", "at 1 s for 0.5 s", "at 1 s for 2 s"]
    assert (built[2].trigger.hold, built[2].trigger.hold_s) == (Hold.FOR, 2.0)
    assert built[2].label.endswith(", A, at 1 s for 2 s")
    assert built[8].label.endswith(", A, always for 2 s")


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"scenario": "C"}, "no scenario 'C'; expected one of A, B, as in the"),
        ({"hold_s": 0}, "hold_s.*a number of seconds above 0"),
        ({"setting": "alone"}, "expected a list of changes"),
        ({"setting": ["lonely"]}, "change 'lonely'; expected one of alone"),
        ({"after_hazard": "end"}, "'end'; expected `go_on` or `stop`"),
        ({"seed": -1}, "seed"),
        ({"hold_s": 1e300}, "hold_s.*above 0, at most"),
        ({"hold_s": 10**400}, "hold_s.*a number"),
        ({"value": 10**400}, "value.*a number"),
        ({"value": 2.5000001}, r"value 2.5000001 is outside .*, \S+ to 2.5 m"),
        ({"setting": None}, "None; expected a list of changes"),
        ({"setting": ["alone", "alone"]}, "expected each change once"),
        ({"trigger": Trigger(name="x", condition="import os")}, "trigger.*import os"),
        ({"trigger": Trigger(name="x", condition="nope > 1")}, "trigger.*nope"),
    ],
)
def test_a_wrong_argument_is_named(toycar: Workspace, arguments: dict[str, object], expected: str) -> None:
    """Each mistake is an error that names the value and what was expected."""
    with pytest.raises(MutatorError, match=expected):
        mutator.build_experiment(
            "sensor/lane/shifted",
            **({"scenario": "A"} | arguments),
            workspace=toycar,  # type: ignore[arg-type]
        )


def test_an_experiment_can_stop_at_a_hazard_and_have_a_setting(toycar: Workspace) -> None:
    """Both are part of the experiment, as in a campaign."""
    built = mutator.build_experiment(
        "sensor/lane/shifted", "A", setting=["alone"], after_hazard="stop", workspace=toycar
    )
    assert (built.changes, built.after_hazard) == (("alone",), AfterHazard.STOP)
