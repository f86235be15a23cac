"""Each place that `mutator places` lists can be found again and accepts the models listed for it."""

from collections import Counter
from pathlib import Path

import pytest

from mutator.config.location_yaml import LocationModel
from mutator.config.yaml_source_lines import YamlSource
from mutator.errors import MutatorError
from mutator.faults.fault_models import ParamSchema
from mutator.model import LOAD_TIME_ANCHORS, VALUE_ANCHORS, AnchorKind, Injection, Value
from mutator.mutants.injection_edits import injection_edit
from mutator.mutants.parsed_files_and_anchors import parse_file
from mutator.mutants.possible_places import ListedPlace, places_of
from mutator.workspace import Workspace

SOURCE = b"""LIMIT = 5


class Sensor:
    gain = 2.0

    def measure(self, world, factor=1.5):
        gap = world.gap * factor
        if gap > LIMIT: gap = LIMIT
        self.send(round(gap), key="gap")
        for value in self.seen:
            gap = gap + value
        if not gap:
            return None
        return gap


def other(x):
    return x
"""
VALUES: dict[str, Value] = {
    "import": "m.Effect",
    "number": 1.0,
    "integer": 1,
    "boolean": False,
    "constant": 3.0,
    "seed": 5,
    "expression": "message.topic",
}


def value(param: ParamSchema) -> Value:
    if param.type == "variable":
        return "gap"
    if param.type == "choice":
        return param.choices[0]
    if param.type == "unit":
        return "km" if "read" in param.name else "m"
    return VALUES[param.type]


@pytest.fixture(scope="module")
def listed(shipped: Workspace) -> list[ListedPlace]:
    return places_of(parse_file("m.py", SOURCE, Path("x")), shipped.fault_models())


@pytest.fixture(scope="module")
def shipped() -> Workspace:
    return Workspace.find(root=Path(__file__).parents[4])


def test_an_ambiguous_place_is_listed_with_nth(listed: list[ListedPlace]) -> None:
    found = [(one.line, {k: v for k, v in one.at.items() if k not in ("file", "function")}) for one in listed]
    assert found[:3] == [
        (1, {"constant": "LIMIT"}),
        (5, {"constant": "Sensor.gain"}),
        (7, {"default": "factor"}),
    ]
    for wanted in (
        (8, {"entry": True}),
        (8, {"after_assign": "gap", "nth": 1}),
        (8, {"assigned_value": "gap", "nth": 1}),
        (9, {"condition": "gap > LIMIT"}),
        (9, {"assigned_value": "gap", "nth": 2}),
        (10, {"before_call": "self.send"}),
        (10, {"argument": "self.send", "which": 1}),
        (10, {"argument": "self.send", "which": "key"}),
        (12, {"after_assign": "value"}),
        (14, {"return_value": "None"}),
        (14, {"before_return": "", "nth": 1}),
        (15, {"before_return": "gap"}),
    ):
        assert wanted in found
    assert (9, {"after_assign": "gap", "nth": 2}) not in found, "it shares the line of its `if`"


def test_each_listed_anchor_finds_its_own_line(listed: list[ListedPlace]) -> None:
    source = YamlSource(path=Path("spec.yaml"), data={}, lines={})
    assert [LocationModel(**one.at).build_location(source, ()) for one in listed] == [
        one.location for one in listed
    ]
    file = parse_file("m.py", SOURCE, Path("x"))
    for one in listed:
        assert file.line_span(one.location)[0] + 1 == one.line or one.location.anchor.name == "value", one
    assert max(Counter(one.location for one in listed).values()) == 1


def test_each_model_can_be_injected_at_the_places_that_list_it(
    shipped: Workspace, listed: list[ListedPlace]
) -> None:
    file, models, tried = parse_file("m.py", SOURCE, Path("x")), shipped.fault_models(), Counter[bool]()
    for one in listed:
        if one.location.function == "other":
            continue
        kind = one.location.anchor.kind
        for model in models:
            if model.name in ("ghost_object", "image_effect") or "exchanged" in model.template:
                continue  # these models need more names than a place has
            at_value = kind in VALUE_ANCHORS | LOAD_TIME_ANCHORS
            params = {p.name: value(p) for p in model.params if not (at_value and p.name == "target")}
            given = tuple(sorted(params.items()))
            injection = Injection(location=one.location, model=model.name, params=given)
            works = model.name in one.models
            try:
                injection_edit(file, models, injection, "0a1b2c3d")
            except MutatorError as error:
                assert not works, (one, model.name, str(error))
            tried[works] += 1
    assert tried[True] > 300


def test_the_places_of_one_function_can_be_listed(shipped: Workspace) -> None:
    file = parse_file("m.py", SOURCE, Path("x"))
    found = places_of(file, shipped.fault_models(), "other")
    assert {one.location.function for one in found} == {"other"}
    with pytest.raises(MutatorError, match=r"no function 'Sensor.mesure'.*did you mean 'Sensor.measure'"):
        places_of(file, shipped.fault_models(), "Sensor.mesure")


def test_models_that_repeat_or_move_a_yield_are_not_listed(shipped: Workspace) -> None:
    """Such models would change what the generator yields."""
    file = parse_file("m.py", b"def f(a):\n    b = yield a\n    c = b\n    return c\n", Path("x"))
    places = [one for one in places_of(file, shipped.fault_models()) if "before_assign" in one.at]
    models = {one.line: one.models for one in places}
    assert not {"repetition", "reordering"} & set(models[2])
    assert "repetition" in models[3]


@pytest.mark.parametrize(
    "kind", ["later", "1 / 0", "round(2) > LIMIT", "[x for x in len(2)]", "lambda q=1: q + 1"]
)
def test_annotations_are_no_places(shipped: Workspace, kind: str) -> None:
    """Since Python 3.14, they need not even run. A call in one does not count as a call of that name."""
    plain = SOURCE.decode()
    annotated = plain.replace("world, factor", f"world: {kind}, factor: {kind}").replace(
        "):", f") -> {kind}:"
    )
    for name in ("LIMIT", "    gain", "        gap"):
        annotated = annotated.replace(f"{name} =", f"{name}: {kind} =")
    assert annotated.count(kind) == 8
    files = [parse_file("m.py", text.encode(), Path("x")) for text in (plain, annotated)]
    first, second = (
        [(file.line_span(one.location), one) for one in places_of(file, shipped.fault_models())]
        for file in files
    )
    assert first == second


def test_models_that_call_a_function_that_the_file_hides_are_not_listed(shipped: Workspace) -> None:
    """`ghost_object` always calls `max`; `offset` does only with a bound, so it stays."""
    source = b"def f(a, max):\n    x = a\n    return x\n\n\ndef g(a):\n    x = a\n    return x\n"
    models_by_function = {
        place.location.function: place.models
        for place in places_of(parse_file("m.py", source, Path("x")), shipped.fault_models())
        if place.location.anchor.kind is AnchorKind.AFTER_ASSIGN
    }
    assert set(models_by_function["g"]) - set(models_by_function["f"]) == {"ghost_object"}
    source = b"float = 3.0\nLIMIT = 2.0\n"
    (*_, limit) = places_of(parse_file("m.py", source, Path("x")), shipped.fault_models())
    assert not {"nan", "infinity"} & set(limit.models)
    assert "offset" in limit.models
