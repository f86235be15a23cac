"""Records are read from JSON by their annotations alone."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

import pytest

from mutator._common.hashing import added_field, as_json_types
from mutator._common.typed_json import typed_value_from_json
from mutator.errors import TypeMisfit


class Colour(StrEnum):
    RED = "red"
    BLUE = "blue"


class Point(NamedTuple):
    x: float
    colour: Colour


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    name: str
    size: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Whole:
    parts: tuple[Part, ...]
    by_name: Mapping[str, Part] | None
    points: tuple[Point, ...]
    spans: tuple[tuple[int, int] | tuple[int, int, bool], ...]
    more: tuple[str, ...] = added_field(())
    anything: Any

    def __post_init__(self) -> None:
        if len(self.parts) > 2:
            raise ValueError("more than two parts")


PART = Part(name="a", size=None)
WHOLE = Whole(
    parts=(PART, Part(name="b", size=3)),
    by_name={"a": PART},
    points=(Point(0.5, Colour.RED), Point(2, Colour.BLUE)),
    spans=((0, 1), (1, 2, True)),
    anything=[{"x": [1]}],
)


def test_what_was_written_is_read() -> None:
    for whole in (WHOLE, Whole(parts=(), by_name=None, points=(), spans=(), more=("m",), anything=None)):
        data = json.loads(json.dumps(as_json_types(whole)))
        found = typed_value_from_json(Whole, data)
        assert found == whole
        assert json.dumps(as_json_types(found)) == json.dumps(data)


@pytest.mark.parametrize(
    ("change", "path", "got", "expected"),
    [
        ({"parts": {}}, ["parts"], "an object", "a list"),
        ({"parts": [3]}, ["parts", 0], "3", "an object"),
        ({"parts": [{"name": "a"}]}, ["parts", 0], "no key 'size'", None),
        (
            {"parts": [as_json_types(PART) | {"x": 1}]},
            ["parts", 0],
            "an unknown key 'x'",
            "only name, size",
        ),
        ({"parts": [as_json_types(PART)] * 3}, [], "more than two parts", None),
        ({"by_name": {"a": {"name": 1, "size": 1}}}, ["by_name", "a", "name"], "1", "text"),
        ({"by_name": 7}, ["by_name"], "7", "an object or a list or null"),
        (
            {"parts": [{"name": "a", "size": True}]},
            ["parts", 0, "size"],
            "True",
            "a whole number or null",
        ),
        ({"points": [[0.5]]}, ["points", 0], "a list of 1", "a list of 2"),
        ({"points": [["0.5", "red"]]}, ["points", 0, 0], "'0.5'", "a number"),
        ({"points": [[0.5, "green"]]}, ["points", 0, 1], "'green'", "one of red, blue"),
        ({"points": [[0.5, []]]}, ["points", 0, 1], "a list", "one of red, blue"),
        ({"spans": [[0, 1, 1]]}, ["spans", 0, 2], "1", "true or false"),
        ({"more": "m"}, ["more"], "'m'", "a list"),
        ({"more": ["\x1b[2J" * 99]}, None, None, None),
    ],
)
def test_what_does_not_fit_is_refused_with_its_place(
    change: dict[str, Any], path: list[str | int] | None, got: str | None, expected: str | None
) -> None:
    data = as_json_types(WHOLE) | change
    if path is None:
        assert typed_value_from_json(Whole, data).more == tuple(change["more"])
        return
    with pytest.raises(TypeMisfit) as refused:
        typed_value_from_json(Whole, data)
    assert (refused.value.path, refused.value.got, refused.value.expected) == (path, got, expected)


def test_a_value_in_a_message_is_short_and_printable() -> None:
    with pytest.raises(TypeMisfit) as refused:
        typed_value_from_json(int, "\x1b[2J" * 99)
    assert refused.value.got.isprintable() and len(refused.value.got) < 70


def test_text_that_no_file_can_have_is_refused() -> None:
    """JSON can spell half of a character, but UTF-8 has none."""
    with pytest.raises(TypeMisfit) as error:
        typed_value_from_json(Part, json.loads(r'{"name": "a\ud800", "size": null}'))
    assert (error.value.got, error.value.path) == (r"'a\ud800'", ["name"])
    assert (
        typed_value_from_json(Part, json.loads(r'{"name": "\ud83d\ude00", "size": null}')).name
        == "\U0001f600"
    )
