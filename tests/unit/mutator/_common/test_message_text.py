"""Hints for operators of other languages."""

import pytest

from mutator._common.message_text import (
    python_operator_hint,
    rounded_percent,
    shortened_ids,
    unbreakable_parts,
    with_unbreakable_numbers,
)
from mutator.campaigns.row_filters import compile_filter
from mutator.errors import MutatorError
from mutator.triggers.conditions import canonical_condition


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("a && b", "write 'and' for '&&'"),
        ("a || !b", "write 'or' for '||', write 'not' for '!'"),
        ("a = 3", "write '==' for '='"),
        ("a != 3 and b <= 2 and c >= 1 and d == 0", ""),
        ("match(name, 'a=!b&&') and", ""),
    ],
)
def test_operators_of_other_languages_get_a_hint(text: str, hint: str) -> None:
    assert python_operator_hint(text) == hint


@pytest.mark.parametrize("text", ["t > 2 && v > 3", "t > 2 || v > 3", "!(t > 2)", "t = 2"])
def test_errors_in_conditions_and_filters_contain_the_hint(text: str) -> None:
    for refused in (canonical_condition, lambda text: compile_filter(text, ("t", "v"))):
        with pytest.raises(MutatorError) as caught:
            refused(text)
        assert python_operator_hint(text) in str(caught.value)
        assert caught.value.remedy == python_operator_hint(text)


def test_units_comparisons_and_commands_are_not_folded() -> None:
    text = "at 6.4 m/s while hwt <= 2.0 and rs > 0.0: run `pip install x`"
    assert unbreakable_parts(text) == [
        "at",
        "6.4\u00a0m/s",
        "while",
        "hwt\u00a0<=\u00a02.0",
        "and",
        "rs\u00a0>\u00a00.0:",
        "run",
        "`pip\u00a0install\u00a0x`",
    ]


def test_a_number_in_a_page_stays_with_its_unit() -> None:
    """Commands and lists of a page are copied, so they keep their spaces."""
    text = "from 24.60 s at 3.35 m/s by 12 deg, 95 % of 3 faults: `run -n 2 --out x`"
    bound = "from 24.60_s at 3.35_m/s by 12_deg, 95_% of 3 faults: `run -n 2 --out x`"
    assert with_unbreakable_numbers(text) == bound.replace("_", "\u00a0")


def test_ids_have_eight_characters_where_that_is_unique() -> None:
    """Otherwise as many as make them different, or all."""
    assert shortened_ids(["0123456789abcdef", "1123456789abcdef"]) == ["01234567", "11234567"]
    assert shortened_ids(["0123456789abcdef", "0123456780abcdef"]) == ["0123456789", "0123456780"]
    assert shortened_ids(["short", "shorter"]) == ["short", "shorter"]


@pytest.mark.parametrize(
    ("part", "whole", "text"),
    [
        (0, 300, "0"),
        (1, 300, "under 1"),
        (1, 200, "under 1"),
        (199, 200, "over 99"),
        (2, 300, "1"),
        (298, 300, "99"),
        (299, 300, "over 99"),
        (300, 300, "100"),
    ],
)
def test_only_none_is_0_and_only_all_is_100_percent(part: int, whole: int, text: str) -> None:
    assert rounded_percent(part, whole) == text
