"""Valid and invalid filter expressions, which never run as code."""

import re
import warnings

import pytest

from mutator.campaigns.row_filters import compile_filter, matching_items
from mutator.errors import MutatorError

ROW = {"fault_type": "ghost_vehicle", "scenario": "S2", "value": 120, "unit": None, "method": "guided"}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('scenario == "S2"', True),
        ('scenario != "S2"', False),
        ("value > 100 and value <= 120", True),
        ("100 < value < 120", False),
        ("value == -120", False),
        ('scenario in ("S1", "S2")', True),
        ('scenario not in ["S1", "S3"]', True),
        ('"ghost" in fault_type', True),
        ('match(fault_type, "ghost*")', True),
        ('match(unit, "*")', False),
        ('not method == "random" and (value < 5 or value > 50)', True),
        ("unit == None", True),
        ("unit < 5", False),
        ("not unit < 5", True),
        ("unit", False),
        ("fault_type", True),
    ],
)
def test_filter_expressions_work_as_in_python(text: str, expected: bool) -> None:
    """An empty cell is neither less nor greater than any value."""
    assert compile_filter(text, ROW)(ROW) is expected


@pytest.mark.parametrize(
    "text",
    [
        "",
        "value >",
        "scenario = 'S1'",
        "nosuch == 1",
        "__import__('os').system('true')",
        "value.real > 1",
        "value + 1 > 2",
        "(lambda: 1)() == 1",
        "[x for x in (1,)] == 1",
        "scenario is None",
        "match(scenario)",
        "match(scenario, method)",
        "match('a', value, 3)",
        "value[0] == 1",
        "f'{value}' == 'x'",
        "1",
        "(" * 500,
        "value == " + "-" * 1500 + "1",
        "value == " + "1" * 3000,
    ],
)
def test_an_invalid_filter_is_refused(text: str) -> None:
    with pytest.raises(MutatorError) as error:
        compile_filter(text, ROW)
    assert "filter" in str(error.value)


def test_the_error_for_an_unknown_column_lists_the_known_columns() -> None:
    with pytest.raises(MutatorError, match=r"unknown column `speed`.*fault_type.*value"):
        compile_filter("speed > 1", ROW)


def test_an_old_column_name_is_answered_with_the_new_one() -> None:
    """Only where that column can be used."""
    old = "fault_tolerant_time < 2"
    with pytest.raises(MutatorError) as caught:
        compile_filter(old, ["value", "time_to_hazard"])
    assert caught.value.remedy == "write `time_to_hazard`, the name of this column now"
    with pytest.raises(MutatorError) as caught:
        compile_filter(old, ["value"])
    assert caught.value.remedy == "correct the name"


def test_a_misspelt_column_is_answered_with_the_nearest_one() -> None:
    with pytest.raises(MutatorError) as caught:
        compile_filter("modul == 'radar'", ["module", "value"])
    assert caught.value.remedy == "correct the name; did you mean 'module'?"


@pytest.mark.parametrize("text", ['value > "S1"', "scenario in 5"])
def test_comparing_incompatible_values_is_a_mutator_error(text: str) -> None:
    accepts = compile_filter(text, ROW)
    with pytest.raises(MutatorError):
        accepts(ROW)


@pytest.mark.parametrize(
    ("text", "warning"),
    [
        ("fault_type == 'chaf'", "did you mean .chaff.[?] Its values: chaff, ghost_vehicle$"),
        ("'chaf' != fault_type", "`fault_type` is never 'chaf' here; did you mean 'chaff'[?] Its"),
        (
            "value > 1 and hazard in ('H1', 'H9')",
            "`hazard` is never 'H9' here. Its values: H1$",
        ),
        ("hazard == 'zzz'", "`hazard` is never 'zzz' here. Its values: H1$"),
        ("fault_type == 'chaff' or 'cha' in fault_type or hazard == None or hazard == ''", None),
        ("name == 'n'", None),
    ],
)
def test_a_text_that_a_column_never_has_is_a_warning(text: str, warning: str | None) -> None:
    """A misspelt value would otherwise leave nothing without a word. Columns of many values are exempt."""
    rows: list[dict[str, object]] = [
        {"fault_type": "chaff", "hazard": None, "value": 1, "name": "a"},
        {"fault_type": "ghost_vehicle", "hazard": "H1", "value": 2, "name": "b"},
        *({"fault_type": "chaff", "hazard": None, "value": 0, "name": str(i)} for i in range(30)),
    ]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        list(matching_items(rows, text, rows[0], lambda row: row))
    assert len(caught) == (warning is not None)
    if warning is not None:
        assert re.search(warning, str(caught[0].message))


def test_matching_items_are_kept_or_left_out() -> None:
    rows = [{"value": number} for number in range(5)]
    assert list(matching_items(rows, "value > 2", ["value"], lambda row: row)) == rows[3:]
    assert (
        list(matching_items(rows, "value > 2", ["value"], lambda row: row, keeps_matches=False)) == rows[:3]
    )
