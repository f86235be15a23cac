"""The ids of records stay the same when records get new fields."""

import json
from dataclasses import dataclass, replace

import pytest

from mutator import model
from mutator._common.hashing import (
    added_field,
    as_json_types,
    content_id,
    digest,
    non_default_added_fields,
    parse_json,
)
from mutator.model import Anchor, AnchorKind, FaultLocation, Hold, Method

LOCATION = FaultLocation(
    path="pkg/radar.py", function="measure", anchor=Anchor(kind=AnchorKind.AFTER_ASSIGN, name="d_rel")
)
PARAMS = (("by", 40.0), ("target", "d_rel"))
CONDITION = "hwt <= 2.0"


# The records of a later version, each with one more field.
@dataclass(frozen=True, slots=True, kw_only=True)
class Injection(model.Injection):
    every: int = added_field(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Trigger(model.Trigger):
    fade: Hold | None = added_field(None)


@dataclass(frozen=True)
class Fault(model.Fault):
    tags: tuple[str, ...] = added_field(())


@dataclass(frozen=True)
class Experiment(model.Experiment):
    repeat: int = added_field(0)


def fault(kind: type[model.Fault], injection: type[model.Injection], **more: object) -> model.Fault:
    injections = (injection(location=LOCATION, model="offset", params=PARAMS),)
    return kind("radar/chaff/d", "radar", "chaff", "as_described", 40.0, "m", "H1", injections, **more)


def experiment(
    kind: type[model.Experiment], trigger: type[model.Trigger], of: model.Fault, **more: object
) -> model.Experiment:
    return kind(of, "S1", "d" * 64, Method.GUIDED, trigger(name="C1", condition=CONDITION), 7, **more)


OLD_FAULT = fault(model.Fault, model.Injection)
OLD = experiment(model.Experiment, model.Trigger, OLD_FAULT)


def test_ids_are_those_of_the_first_release() -> None:
    """Published results cite these ids."""
    assert (OLD_FAULT.id, OLD.id) == ("a128796d71e1fdf8", "876900fefe457b38")
    assert content_id([OLD_FAULT.injections[0], OLD.trigger]) == "f51174baeee5206c"


def test_an_added_field_at_its_default_changes_no_id() -> None:
    new_fault = fault(Fault, Injection)
    new = experiment(Experiment, Trigger, new_fault)
    assert (new_fault.id, new.id) == (OLD_FAULT.id, OLD.id)
    assert as_json_types(new_fault) == as_json_types(OLD_FAULT) and as_json_types(
        new.trigger
    ) == as_json_types(OLD.trigger)
    assert (non_default_added_fields(new), non_default_added_fields(OLD)) == ({}, {})


def test_an_added_field_with_another_value_changes_the_id() -> None:
    tagged = fault(Fault, Injection, tags=("wet",))
    injection = Injection(location=LOCATION, model="offset", params=PARAMS, every=2)
    rarer = replace(fault(Fault, Injection), injections=(injection,))
    assert len({OLD_FAULT.id, tagged.id, rarer.id}) == 3
    new = experiment(Experiment, Trigger, OLD_FAULT)
    of_tagged = experiment(Experiment, Trigger, tagged)
    fading = replace(new, trigger=Trigger(name="C1", condition=CONDITION, fade=Hold.FOR))
    assert len({OLD.id, replace(new, repeat=1).id, fading.id, of_tagged.id}) == 4
    assert as_json_types(fading.trigger)["fade"] == "for"
    assert non_default_added_fields(replace(new, repeat=1)) == {"repeat": 1}


def test_fields_of_the_first_release_are_hashed_even_at_their_defaults() -> None:
    assert as_json_types(Anchor(kind=AnchorKind.ENTRY)) == {"kind": "entry", "name": "", "nth": None}


def test_values_of_different_types_have_different_digests() -> None:
    values = [1.0, 1, True, "1", None, [1], [[1]], {"a": 1}, b"1 "]
    assert len({digest(value) for value in values}) == len(values)


@pytest.mark.parametrize(
    "text",
    ["[1.5, -0.0, 1e-7]", "NaN", "[Infinity, -1e999]", "18446744073709551615", '"\\ud800"', "-0"],
)
def test_json_is_read_as_the_standard_library_reads_it(text: str) -> None:
    """By itself, the faster JSON reader refuses NaN, infinities and lone surrogates."""
    assert repr(parse_json(text.encode())) == repr(json.loads(text))


@pytest.mark.parametrize("data", [b"", b"{", b"\xff", b"[1,]"])
def test_invalid_json_raises_a_value_error(data: bytes) -> None:
    with pytest.raises(ValueError):
        parse_json(data)
