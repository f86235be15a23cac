"""Any file content is read or refused, without side effects."""

import math
import time
from codecs import BOM_UTF8
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from mutator._common.files import read_json
from mutator.campaigns.row_filters import compile_filter
from mutator.config import yaml_files
from mutator.errors import MutatorError
from mutator.faults.fault_specs import load_spec
from mutator.faults.library_readings import NO_READINGS
from mutator.mutants.parsed_files_and_anchors import parse_file
from mutator.mutants.template_rendering import python_literal, signed_term
from mutator.triggers.conditions import canonical_condition, evaluate_condition

QUIET = [HealthCheck.function_scoped_fixture]
SPEC = Path(__file__).parents[2] / "fault_library" / "faults" / "car_sensors" / "speed.yaml"
TEXT = st.text(st.characters(exclude_characters="\0", codec="utf-8"))  # YAML files may not have NUL
PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | TEXT,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXT, inner, max_size=3),
    max_leaves=10,
)


@settings(max_examples=200, deadline=None, suppress_health_check=QUIET)
@given(
    st.binary(max_size=200)
    | st.text(max_size=200).map(str.encode)
    | st.text("a: -[]{}#&*!|>'\"\n\t%@", max_size=60).map(str.encode)
)
def test_any_bytes_are_read_or_refused(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "x.yaml"
    path.write_bytes(data)
    try:
        yaml_files.load_yaml(path)
    except MutatorError as error:
        assert str(error).startswith(str(path))


@settings(max_examples=100, deadline=None, suppress_health_check=QUIET)
@given(PLAIN)
def test_plain_data_keep_their_values(tmp_path: Path, value: object) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(yaml.safe_dump(value, allow_unicode=True, default_style='"'), encoding="utf-8")
    text = path.read_text(encoding="utf-8")
    if "!!" in text or "\x85" in text or "\u2028" in text or "\u2029" in text:
        return
    source = yaml_files.load_yaml(path)
    assert source.data == value
    assert source.lines[()] == 1


@settings(max_examples=150, deadline=None, suppress_health_check=QUIET)
@given(st.data())
def test_a_damaged_spec_is_read_or_refused(tmp_path: Path, data: st.DataObject) -> None:
    lines = SPEC.read_text().splitlines()
    i = data.draw(st.integers(0, len(lines) - 1))
    how = data.draw(st.sampled_from(["drop", "double", "garble", "indent"]))
    if how == "drop":
        del lines[i]
    elif how == "double":
        lines.insert(i, lines[i])
    elif how == "indent":
        lines[i] = "  " + lines[i]
    else:
        j = data.draw(st.integers(0, len(lines[i])))
        lines[i] = lines[i][:j] + data.draw(st.text(max_size=3)) + lines[i][j + 1 :]
    path = tmp_path / "x.yaml"
    path.write_text("\n".join(lines), encoding="utf-8", errors="surrogatepass")
    try:
        spec = load_spec(path, NO_READINGS)
    except MutatorError as error:
        assert str(error).startswith(str(path)) and error.got
    else:
        assert spec.fault_count > 0


@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=100) | st.text("def f(x):\n=1#\"'\\ \t;", max_size=80).map(str.encode))
@example(BOM_UTF8)
@example(b"#\x80")  # LibCST's error has no line
def test_any_source_is_read_or_refused(data: bytes) -> None:
    try:
        file = parse_file("x.py", data, Path("root"))
    except MutatorError as error:
        assert "x.py" in str(error)
    else:
        assert b"".join(file.lines) == data.removeprefix(BOM_UTF8)


@given(st.floats() | st.integers(-(10**30), 10**30))
def test_rendered_numbers_are_exact(value: float) -> None:
    assert repr(eval(python_literal(value))) == repr(value)
    if value == value:
        assert eval(f"0 {signed_term(value)}") == value


@given(st.floats(), st.floats(allow_nan=False), st.sampled_from(["float", "np.float64", "np.float32"]))
def test_adding_a_whole_number_equals_adding_a_float(variable: float, value: float, kind: str) -> None:
    sign = "-" if math.copysign(1.0, value) < 0 else "+"
    with np.errstate(all="ignore"):
        texts = (f"{kind}(x) {signed_term(value)}", f"{kind}(x) {sign} {python_literal(abs(value))}")
        found, expected = (eval(text, {"x": variable, "np": np}) for text in texts)
    assert (type(found), repr(found)) == (type(expected), repr(expected))


@pytest.mark.parametrize("value", [[1], {"a": 1}, object()])
def test_only_numbers_and_names_are_rendered(value: object) -> None:
    with pytest.raises(MutatorError):
        python_literal(value)


SHAPES = {
    "open lists": "a: " + "[" * 900,
    "deep lists": "[" * 50_000 + "]" * 50_000,
    "open lists without end": "[" * 200_000,
    "open mappings": "{a: " * 200_000,
    "open lists on lines": "[\n" * 200_000,
    "deep block lists": "- " * 400_000,
    "deep block mappings": "".join(" " * i + "a:\n" for i in range(1300)),
    "deep keys": "? " * 400_000,
    "directives": "".join(f"%TAG !a{i}! b\n" for i in range(50_000)) + "---\na: 1\n",
    "later directives": "a: 1\n...\n" + "".join(f"%TAG !a{i}! b\n" for i in range(50_000)),
    "a wide list": "[" + "1," * 400_000 + "]",
    "a wide mapping": "".join(f"k{i}: 1\n" for i in range(80_000)),
    "documents": "---\n" * 200_000,
    "too large a file": "a" * 1_000_001,
}


@pytest.mark.parametrize("shape", SHAPES)
def test_input_that_takes_long_to_parse_is_refused_at_once(tmp_path: Path, shape: str) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(SHAPES[shape], encoding="utf-8")
    began = time.process_time()
    with pytest.raises(MutatorError) as refused:
        yaml_files.load_yaml(path)
    assert time.process_time() - began < 1.0
    assert refused.value.where == str(path)
    assert refused.value.line is not None or shape == "too large a file"


@settings(max_examples=200, deadline=None, suppress_health_check=QUIET)
@given(
    st.lists(st.sampled_from(["[", "]", "{", "}", "- ", "? ", ": ", ",", "\n", "a", "'", " ", "%"])),
    st.data(),
)
def test_any_punctuation_is_read_or_refused_quickly(
    tmp_path: Path, words: list[str], data: st.DataObject
) -> None:
    text = "".join(word * data.draw(st.sampled_from([1, 1, 1, 1000, 50_000])) for word in words)
    path = tmp_path / "x.yaml"
    path.write_text(text, encoding="utf-8")
    began = time.process_time()
    with suppress(MutatorError):
        yaml_files.load_yaml(path)
    assert time.process_time() - began < 2.0


NESTED = {
    "parentheses": "(" * 400 + "t" + ")" * 400,
    "signs": "t < " + "-" * 900 + "1",
    "negations": "not " * 200 + "t < 1",
    "calls": "t < " + "abs(" * 150 + "1" + ")" * 150,
    "sums": "t < 1" + "+1" * 450,
    "attributes": "t" + ".t" * 450,
    "tuples": "t in " + "(" * 150 + "1," + ")" * 150,
    "globs": 'match(t, "' + "*a" * 400 + 'b")',
    "a long text": "t < 1 " + "and t < 1 " * 10_000,
}


@pytest.mark.parametrize("nested", NESTED)
def test_nested_expressions_are_evaluated_or_refused_quickly(nested: str) -> None:
    began = time.process_time()
    with suppress(MutatorError):
        evaluate_condition(canonical_condition(NESTED[nested]), {"t": 1.0})
    with suppress(MutatorError):
        compile_filter(NESTED[nested], ["t"])({"t": "a" * 200})
    assert time.process_time() - began < 1.0


def test_too_deeply_nested_json_is_reported_as_damaged(tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text("[" * 100_000)
    with pytest.raises(MutatorError, match=r"x\.json: not JSON"):
        read_json(tmp_path / "x.json", "x/1")
