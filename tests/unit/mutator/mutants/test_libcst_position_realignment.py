"""Positions in the text that LibCST would write become positions in the file."""

import re

import libcst as cst
import pytest
from libcst.metadata import MetadataWrapper, PositionProvider

from mutator.mutants.libcst_position_realignment import align_positions

SOURCES = [
    "x = f'{a !r }' + f'{b  !s :>{c }}' + d\n",  # valid since Python 3.12
    "x = f'{f(a, 'b') !r }', y\n",
    "try: a\nexcept E :\n    b = c\n",
    "a = 1\n\\\nb = a + 'c  \\\n d'\n",
    "def f(x):\n    y = g(x)\n\x0cdef g(ä): return ä + 'ö' \n\n  \n",
    "def f(x):\r\n\x0c    y = g(x)\r\n\\\r\n    z = y",
]


def without_lost_characters(text: str) -> str:
    return re.sub(r"[ \t\f\r\n\\]", "", text)


@pytest.mark.parametrize("source", SOURCES)
def test_each_expression_is_where_the_file_has_it(source: str) -> None:
    module = cst.parse_module(source)
    assert module.code != source
    positions = MetadataWrapper(module, unsafe_skip_copy=True).resolve(PositionProvider)
    aligned = align_positions(positions, module.code, source)
    assert aligned is not None
    lines = re.findall(r"[^\r\n]*(?:\r\n|\n|\Z)", source)
    expressions = [node for node in positions if isinstance(node, cst.BaseExpression)]
    assert expressions
    for node in expressions:
        span = aligned[node]
        text = "".join(lines[span.start.line - 1 : span.end.line])
        behind = len(lines[span.end.line - 1]) - span.end.column
        text = text[span.start.column : len(text) - behind]
        assert text == text.strip()
        # parentheses are no part of the position
        assert without_lost_characters(text) in without_lost_characters(module.code_for_node(node))


def test_other_changes_are_no_matter_of_positions() -> None:
    module = cst.parse_module("a = 1\n")
    positions = MetadataWrapper(module, unsafe_skip_copy=True).resolve(PositionProvider)
    assert align_positions(positions, "a = 1\n", "a = 2\n") is None
