"""If a normalized source compiles, so does every source with this normalized form."""

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mutator.mutants.normalized_source import normalize_numbers_and_ids, normalized_source_compiles

NUMBERS = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False).map(lambda x: repr(abs(x))), st.integers(0).map(str)
)
AROUND = ["x = {}", "x{} = 1", "x = '{}'", "x = -{}", "x = {}.5", "x = 1{}", "x = 0x{}", "x = {}j", "x[{}]"]
AROUND += ["x = '\\{}'", "x = f'{{{}}}'", "x = {} if {} else 0", "é{} = 1", "x = {}_0", "x = {}.real"]
IDS = st.text("0123456789abcdef", min_size=8, max_size=8)


@pytest.mark.parametrize(
    ("text", "kept"),
    [
        ("x + 35.0", "x + 0.0"),
        ("x - 1e-09", "x - 0.0"),
        ("min(7, 1.5e+300)", "min(0, 0.0)"),
        ("x5 = a[12]", "x5 = a[0]"),
        ("float('nan')", "float('nan')"),
        ("007", "007"),
        ("123456789012345678901", "123456789012345678901"),
        ("5. + .5 + 5j + 0x5 + 5_0", "5. + .5 + 5j + 0x5 + 5_0"),
        ("'\\1'", "'\\1'"),
        ("é5 = 5", "é5 = 0"),
    ],
)
def test_plain_decimal_numbers_become_zero(text: str, kept: str) -> None:
    assert normalize_numbers_and_ids(text, ()) == kept


def test_different_ids_stay_different() -> None:
    ids = ("00000001", "deadbeef")
    text = "a('00000001'); b('deadbeef', '00000001')"
    assert normalize_numbers_and_ids(text, ids) == "a('0f0f0000'); b('0f0f0001', '0f0f0000')"
    assert normalize_numbers_and_ids(text, ids) != normalize_numbers_and_ids(
        "a('00000001'); b('00000001', 'deadbeef')", ids
    )


def test_if_a_source_depends_on_its_numbers_its_normalized_form_does_not_compile() -> None:
    assert normalized_source_compiles(b"x = 12345678")
    assert not normalized_source_compiles(normalize_numbers_and_ids("x = 12345678", ["12345678"]).encode())
    assert not normalized_source_compiles(
        normalize_numbers_and_ids("match x:\n    case {1: a, 2: b}:\n        pass", ()).encode()
    )
    assert not normalized_source_compiles(
        normalize_numbers_and_ids(r"x = '\U0000abcd'", ["0000abcd"]).encode()
    )


@pytest.mark.filterwarnings("ignore")  # warnings about escapes in the generated texts
@settings(deadline=None)
@given(st.sampled_from(AROUND), NUMBERS)
@example("x = {}", "07")
def test_a_source_compiles_with_any_number_if_its_normalized_form_does(around: str, number: str) -> None:
    text = around.replace("{{", "\0").replace("{}", number).replace("\0", "{").replace("}}", "}")
    if normalized_source_compiles(normalize_numbers_and_ids(text, ()).encode()):
        compile(text, "x", "exec")


@pytest.mark.filterwarnings("ignore")  # warnings about escapes in the generated texts
@settings(deadline=None)
@given(st.sampled_from(AROUND), IDS)
@example("x = {}", "12345678")
@example("x = {}", "abcdefab")
@example("x = 1{}", "00000000")
def test_a_source_compiles_with_any_id_if_its_normalized_form_does(around: str, name: str) -> None:
    text = around.replace("{{", "\0").replace("{}", name).replace("\0", "{").replace("}}", "}")
    if normalized_source_compiles(normalize_numbers_and_ids(text, [name]).encode()):
        compile(text, "x", "exec")
