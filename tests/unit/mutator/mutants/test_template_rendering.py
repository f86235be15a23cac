"""The rendering of templates into Python code."""

import copy
import math
import types
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mutator.config.yaml_source_lines import YamlSource
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModel, ParamSchema, SnippetKind
from mutator.model import Hold, Value
from mutator.mutants.probe_contract import build_probe_settings, render_probe
from mutator.mutants.template_rendering import render_changed_value, render_snippet
from mutator.triggers.trigger_kinds import always_trigger
from mutator.workspace import Workspace

SOURCE = YamlSource(path=Path("t.yaml"), data={}, lines={})


def model(template: str, kind: SnippetKind = SnippetKind.INSERT) -> FaultModel:
    return FaultModel(
        name="t",
        kind=kind,
        about="",
        params=(
            ParamSchema(name="target", type="variable", about=""),
            ParamSchema(name="by", type="number", about="", optional=True),
        ),
        examples=(),
        template=template,
        source=SOURCE,
        template_path=Path("t.py.j2"),
    )


def rendered(template: str, kind: SnippetKind = SnippetKind.INSERT, **params: Value) -> tuple[str, ...]:
    return render_snippet(model(template, kind), {"target": "x", "by": 1.0, **params}, "ab12")


@pytest.mark.parametrize(
    ("value", "plain", "added"),
    [
        (35.0, "35.0", "+ 35"),
        (-35.0, "-35.0", "- 35"),
        (0.1 + 0.2, "0.30000000000000004", "+ 0.30000000000000004"),
        (-0.0, "-0.0", "- 0"),
        (2.0**53, "9007199254740992.0", "+ 9007199254740992"),
        (1e300, "1e+300", "+ 1e+300"),
        (float("nan"), "float('nan')", "+ float('nan')"),
        (float("inf"), "float('inf')", "+ float('inf')"),
        (float("-inf"), "float('-inf')", "- float('inf')"),
        (7, "7", "+ 7"),
        (True, "True", "+ True"),
    ],
)
def test_numbers_become_exact_literals(value: float, plain: str, added: str) -> None:
    """Added whole numbers have no decimal point, so that an integer variable stays an integer."""
    assert rendered("{{ target }} = {{ by }}\n", by=value) == (f"x = {plain}",)
    assert rendered("{{ target }} = y {{ by | signed }}\n", by=value) == (f"x = y {added}",)


@pytest.mark.parametrize(
    "name", ["x y", "x;y", "import", "x.class", "1x", "", "_fi.active", "x\ny", 3.0, None]
)
def test_a_variable_must_be_a_chain_of_identifiers(name: Value) -> None:
    with pytest.raises(MutatorError):
        rendered("{{ target }} = 1\n", target=name)


@pytest.mark.parametrize("name", ["os;x", "a.b c", "a..b", ".a", "a.import", 1, None])
def test_imported_names_are_checked(name: Value) -> None:
    imports = ParamSchema(name="what", type="import", about="")
    made = replace(model("from {{ what }} import x\n"), params=(imports,))
    assert render_snippet(made, {"what": "a.b"}, "ab12") == ("from a.b import x",)
    with pytest.raises(MutatorError):
        render_snippet(made, {"what": name}, "ab12")


def test_text_is_refused_as_a_number() -> None:
    with pytest.raises(MutatorError, match="'os' for 'by'; expected a number"):
        rendered("{{ target }} = {{ by }}\n", by="os")


@pytest.mark.parametrize(
    ("template", "pieces"),
    [
        ("{{ target = 1\n", ["t.py.j2:1: ", "expected token"]),
        ("x = 1\n{% if by %}\nx = 2\n", ["t.py.j2:3: ", "end of template"]),
        ("x = 1\nx = {{ bye }}\n", ["t.py.j2:2: ", "'bye' is undefined"]),
        ("x = {{ ''.__class__.__mro__ }}\n", ["t.py.j2:1: ", "`.__mro__`"]),
        ("x = {{ target.__class__ }}\n", ["t.py.j2:1: ", "`.__class__`"]),
        ("x = {{ by / 0 }}\n", ["t.py.j2:1: ", "ZeroDivisionError"]),
        ("{% for i in range(1000000) %}x = 1\n{% endfor %}", ["t.py.j2:1: ", "a call of `range`"]),
        ("x = 1\nx = {{ 9 ** 9 ** 9 }}\n", ["t.py.j2:2: ", "`**` is not allowed"]),
        ("x = {{ 'a' * 10 ** 15 }}\n", ["t.py.j2:1: "]),
        ("x = {{ 'a' * 1000000000000000 }}\n", ["t.py.j2:1: ", "str * int"]),
        ("{% macro m() %}{{ m() }}{% endmacro %}{{ m() }}\n", ["t.py.j2:1: ", "`macro`"]),
        ("x = {{ [1] }}\n", ["a list in a template"]),
        ("x = (\n", ["does not give valid Python"]),
        ("x = (1,\n    2)\n", ["one statement a line"]),
        ('x = """a\n    b"""\n', ["one statement a line"]),
        ("x = 1 + \\\n    2\n", ["one statement a line"]),
        ("x = 1\n\nx = 2\n", ["one statement a line"]),
        ("# why\nx = 1\n", ["one statement a line"]),
        ("if x:\n  x = 1\n", ["one statement a line"]),
        ("if x:\n\tx = 1\n", ["one statement a line"]),
        ("if x:\n", ["does not give valid Python"]),
        ("if x:\n    yield x\n", ["t.py.j2: the template contains `yield`"]),
        ("x = yield from x\n", ["t.py.j2: the template contains `yield`"]),
        ("", ["one statement a line"]),
    ],
)
def test_a_template_error_names_template_line_and_reason(template: str, pieces: list[str]) -> None:
    with pytest.raises(MutatorError) as caught:
        rendered(template)
    for piece in pieces:
        assert piece in str(caught.value)


def test_a_guard_opens_a_block() -> None:
    assert rendered("if not {{ target }}:\n", SnippetKind.GUARD) == ("if not x:",)
    with pytest.raises(MutatorError, match="a guard's last line must open a block"):
        rendered("x = 1\n", SnippetKind.GUARD)


@pytest.mark.parametrize(
    ("template", "text"),
    [
        ("0 if {{ original }} else 1", "(0 if y else 1)"),
        ("lambda: {{ original }}", "(lambda: y)"),
        ("{{ original }}, 1", "(y, 1)"),
        ("({{ original }}), (1)", "((y), (1))"),
        ("({{ original }}, 1)", "(y, 1)"),
        ("not {{ original }} or 1", "not y or 1"),
    ],
)
def test_an_expression_stays_one_operand(template: str, text: str) -> None:
    made = replace(model(template, SnippetKind.VALUE), expression_template=template)
    assert render_changed_value(made, {"by": 1.0}, "ab12", "y") == text


@pytest.mark.parametrize("template", ["{{ original }} # why", "1\n", "yield 1", "x = 1", ""])
def test_a_value_must_be_one_expression_without_a_comment(template: str) -> None:
    """A comment would hide the rest of the line."""
    made = replace(model(template, SnippetKind.VALUE), expression_template=template)
    with pytest.raises(MutatorError, match="expected one expression on one line"):
        render_changed_value(made, {"by": 1.0}, "ab12", "y")


@pytest.mark.parametrize("target", ["x # why", "x\n", "x[\n0]", " x", None])
def test_a_target_must_be_a_plain_name(target: Value) -> None:
    """A comment in the target would disable the assignment."""
    made = replace(model("-{{ original }}", SnippetKind.VALUE), expression_template="-{{ original }}")
    for one in (made, model("{{ target }} = {{ target }} + 1")):
        with pytest.raises(MutatorError, match="for 'target'"):
            render_snippet(one, {"target": target, "by": 1.0}, "ab12")


CONSTANT = ParamSchema(name="value", type="constant", about="", optional=True)


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"value": 3.0}, "x = 3.0"),
        ({"value": True}, "x = True"),
        ({"value": None}, "x = None"),
        ({"value": "left"}, "x = 'left'"),
        ({"value": "it's\n# fi:ab12"}, 'x = "it\'s\\n# fi:ab12"'),
        ({}, "x = 0"),
    ],
)
def test_constants_are_written_with_repr(given: dict[str, Value], line: str) -> None:
    template = "x = {% if value is none %}0{% else %}{{ value }}{% endif %}\n"
    assert render_snippet(replace(model(template), params=(CONSTANT,)), given, "ab12") == (line,)


@pytest.mark.parametrize(
    ("name", "params", "value", "result"),
    [
        ("offset", {"by": 35.0}, 40, 75),
        ("offset", {"by": -35.0}, 2**62 + 1, 2**62 - 34),
        ("offset", {"by": 0.5}, 40, 40.5),
        ("offset", {"by": -35.0, "low": 0.0}, 2, 0),
        ("offset", {"by": 35.0, "high": 50.0}, 40, 50),
        ("offset", {"by": -35.0, "low": 0.0}, 2.0, 0.0),
        ("offset", {"by": 3.0}, np.uint8(40), np.uint8(43)),
        ("offset", {"by": -3.0}, np.uint16(40), np.uint16(37)),
        ("offset", {"by": 3.0}, np.float32(40.0), np.float32(43.0)),
        ("offset", {"by": 3.0}, np.array([40, 41], "i2"), np.array([43, 44], "i2")),
        ("scale", {"factor": 2.0}, 40, 80),
        ("scale", {"factor": -0.5}, 40, -20.0),
        ("scale", {"factor": 2.0}, 40.0, 80.0),
        ("scale", {"factor": 2.0}, np.array([40, 41], "u4"), np.array([80, 82], "u4")),
        ("drift", {"per_step": 3.0}, 40, 43),
        ("drift", {"per_step": 0.5}, 40, 40.5),
        ("stuck", {"value": 3.0}, 40, 3),
        ("stuck", {"value": 3.0}, 40.0, 3.0),
        ("stuck", {"value": 3.5}, 40, 3.5),
        ("stuck", {"value": False}, True, False),
        ("stuck", {"value": None}, 40.0, None),
        ("stuck", {"value": "reverse"}, "drive", "reverse"),
        ("stuck", {}, 40, 40),
        ("bit_flip", {"bit": 31.0}, np.float32(1.0), np.float32(-1.0)),
        ("clamp", {"low": -3.0, "high": 3.0}, -5, -3),
        ("clamp", {"low": None, "high": 3.0}, 5.5, 3.0),
        ("clamp", {"low": None, "high": 3.0}, -5.5, -5.5),
        ("clamp", {"low": 0.0, "high": 3.0}, np.array([-1, 2, 9], "i2"), np.array([0, 2, 3], "i2")),
        ("clamp", {"low": 0.0, "high": None}, np.array([-1.0, 2.0]), np.array([0.0, 2.0])),
        ("quantise", {"step": 4.0}, 7, 8),
        ("quantise", {"step": 4.0}, 6.1, 8.0),
        ("quantise", {"step": 4.0}, 6.0, 8.0),
        ("quantise", {"step": 4.0}, 10.0, 8.0),
        ("quantise", {"step": 0.5}, 7, 7.0),
        ("quantise", {"step": 0.5}, math.inf, math.inf),
        ("quantise", {"step": 4.0}, np.float32(6.5), np.float32(8.0)),
        ("quantise", {"step": 10.0}, np.array([4, 16, 254], "u1"), np.array([0, 20, 250], "u1")),
        ("quantise", {"step": 0.5}, np.array([0.3, math.nan]), np.array([0.5, math.nan])),
        ("waveform", {"by": 3, "shape": "alternating", "period": 1.0}, 40, 43),
        ("waveform", {"by": -3, "shape": "pulses", "period": 1.0, "width": 0.1, "low": 38}, 40, 38),
        ("waveform", {"by": 3.0, "shape": "ramp", "period": 1.0}, 40.0, 40.0),
        ("sign_flip", {}, 3, -3),
        ("sign_flip", {}, 0.0, -0.0),
        ("sign_flip", {}, np.array([1.5, -2.0]), np.array([-1.5, 2.0])),
        ("unit_mix_up", {"written_in": "kph", "read_as": "mps"}, 10.0, 36.0),
        ("unit_mix_up", {"written_in": "m", "read_as": "km"}, 3, 3000),
        ("unit_mix_up", {"written_in": "mps", "read_as": "kph"}, 18, 5.0),
        ("byte_corruption", {"index": 1, "mask": 129}, b"\x00\x01", b"\x00\x80"),
        ("byte_corruption", {"index": -1, "mask": 1}, bytearray(b"ab"), bytearray(b"ac")),
        (
            "byte_corruption",
            {"index": 3, "mask": 255},
            np.array([[1, 2], [3, 4]], "u1"),
            np.array([[1, 2], [3, 251]], "u1"),
        ),
        ("nan", {}, 3, math.nan),
        ("nan", {}, np.array([1.0, math.inf], "f4"), np.array([math.nan, math.nan], "f4")),
        ("infinity", {"negative": None}, -3.0, math.inf),
        ("infinity", {"negative": True}, 3, -math.inf),
        ("infinity", {"negative": False}, np.array([1.0, -2.0]), np.array([math.inf, math.inf])),
        ("none", {}, 3, None),
        ("wrong_branch", {"holds": "inverted"}, True, False),
        ("wrong_branch", {"holds": "always"}, False, True),
        ("wrong_branch", {"holds": "never"}, True, False),
    ],
)
def test_a_models_result_has_the_expected_value_and_type(
    clone: Workspace, name: str, params: dict[str, Value], value: Any, result: Any
) -> None:
    models = clone.fault_models()
    given = {"target": "x", **{key: int(v) if key == "bit" else v for key, v in params.items()}}
    given = {key: v for key, v in given.items() if v is not None or key == "value"}
    before = copy.deepcopy(value)
    lines = render_snippet(models.get(name), given, "ab12")
    observation = clone.manifest("openpilot").observation
    settings = build_probe_settings("m", always_trigger(), Hold.WHILE, ("ab12",), observation, 0.1)
    probe = types.ModuleType("_fi")
    exec(render_probe(models.probe_templates, settings).text, vars(probe))
    probe.observe(t=0.0, d_rel=1.0, v_ego=1.0, v_lead=1.0)
    names = {"_fi": probe, "x": value}
    exec("\n".join(lines), names)
    assert type(names["x"]) is type(result)
    assert repr(names["x"]) == repr(result)
    assert repr(value) == repr(before)
    assert getattr(names["x"], "dtype", None) == getattr(result, "dtype", None)
