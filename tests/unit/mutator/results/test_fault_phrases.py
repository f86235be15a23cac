"""Every shipped fault has words of its own, in each reading."""

from dataclasses import replace

import pytest

from mutator.campaigns.phrase_collection import (
    phrases_of_fault,
    phrases_of_models,
    phrases_of_trigger,
    phrases_of_variants,
)
from mutator.errors import MutatorError
from mutator.explore.challengers import challenging_fault
from mutator.faults.injection_parameters import resolve_injection
from mutator.faults.spec_expansion import expand_spec
from mutator.model import Fault
from mutator.results.fault_phrases import describe_fault
from mutator.targets.stored_phrases import Phrases
from mutator.triggers.trigger_kinds import held_for, named_with_hold
from mutator.workspace import Workspace


@pytest.mark.parametrize("reading", ["as_described", "as_coded"])
def test_every_shipped_fault_is_described(clone: Workspace, reading: str) -> None:
    """The phrase of the spec is filled in; no hole and no label is left."""
    models, manifest, specs = clone.fault_models(), clone.manifest("openpilot"), clone.specs()
    faults = [f for spec in specs for f in expand_spec(spec, 1, reading, models=models, manifest=manifest)]
    phrases = Phrases(faults=phrases_of_variants(specs, {fault.spec for fault in faults}, reading))
    words = {fault.label: describe_fault(fault, phrases) for fault in faults}
    assert not [label for label, text in words.items() if text == label or set("{}") & set(text)]


def test_a_reading_has_the_numbers_of_its_own_injections(clone: Workspace) -> None:
    """As coded, 50 mph are read as km/h, so the sensor is wrong by 3.6 times less."""
    words = {}
    for reading in ("as_described", "as_coded"):
        fault = next(f for f in clone.faults("car_sensors/speed/slower", reading=reading) if f.value == 60)
        words[reading] = describe_fault(fault, phrases_of_fault(clone, clone.manifest("openpilot"), fault))
    assert words == {
        "as_described": "the speed sensor reads 60 mph too low",
        "as_coded": "the speed sensor reads 26.8 km/h too low",
    }


def test_a_context_without_a_campaign_has_its_phrase(clone: Workspace) -> None:
    """A trigger that only has a context's name is none."""
    table = clone.context_table("accelerate_decelerate")
    [context] = table.triggers(rows=("C2",))
    assert phrases_of_trigger(clone, context)["C2"][""][0].startswith("while the car is close")
    assert phrases_of_trigger(clone, replace(context, condition="t >= 1.0")) == {}
    held_context = named_with_hold(held_for(context, 2.0))
    assert held_context.name == "C2 for 2 s"
    assert phrases_of_trigger(clone, held_context) == phrases_of_trigger(clone, context)


def test_every_shipped_fault_model_describes_its_examples(clone: Workspace) -> None:
    """Operators and specs without a phrase get the words of their models."""
    models = clone.fault_models()
    phrases = Phrases(models=phrases_of_models(models, {model.name for model in models}))
    for model in models:
        for example in model.examples:
            injection = resolve_injection(example.injection, model, model.source)
            fault = Fault(
                spec="a/b/c", module="a", fault_type="b", reading="", value=None, unit="-", aim="",
                injections=(injection,),
            )  # fmt: skip
            text = describe_fault(fault, phrases)
            assert text != fault.label and not set("{}") & set(text.replace("{}", "")), model.name


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        ("alternating_0.5s", "alternating, with a period of 1 s"),
        ("ramp", "ramp, with a period of 4 s"),
        ("glitch", "pulses of 0.02 s every 0.5 s"),
        ("noise", "noise"),
    ],
)
def test_a_challenger_is_described_by_its_shape_and_a_rounded_size(
    clone: Workspace, name: str, shape: str
) -> None:
    """Its error was converted from mph, and is shown with four digits."""
    fault = next(f for f in clone.faults("car_sensors/speed/slower") if f.value == 60)
    [injection] = fault.injections
    params = tuple(sorted({**dict(injection.params), "by": -2.0760537599999997}.items()))
    fault = replace(fault, injections=(replace(injection, params=params),))
    challenger = challenging_fault(fault, name, duration_s=4.0, step_s=0.01, seed=1)
    text = describe_fault(challenger, phrases_of_fault(clone, clone.manifest("openpilot"), challenger))
    assert text.startswith(f"an error of -2.076 ({shape}) is added to `")


def test_an_unknown_hole_of_a_spec_is_an_error_with_the_holes_that_exist(toy: Workspace) -> None:
    """The numbers of the injections are named in the unit of the source."""
    path = next((toy.library / "faults").rglob("*.yaml"))
    text = path.read_text()
    path.write_text(text.replace("    about: ", "    phrase: the lane is off by {metres}\n    about: ", 1))
    with pytest.raises(MutatorError, match=r":\d+: hole '\{metres\}'; expected \{value\}, \{abs_value\}"):
        toy.faults()
