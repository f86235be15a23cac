"""Compiling only the changed functions of a file shows whether the file compiles."""

from pathlib import Path

import pytest

from mutator.mutants.changed_file_reuse import reuse_key
from mutator.mutants.compile_check_by_function import certainly_compiles_for_key
from mutator.mutants.parsed_files_and_anchors import ParsedFile, parse_file
from mutator.mutants.splicing import EditRank, LineEdit, probe_import_edit

SOURCE = b"""\
LIMIT = 1


class A:
\t@property
\tdef width(self):
\t\tx = 1
\t\tdef inner():
\t\t\tnonlocal x
\t\t\tx = 2
\t\treturn x


def f(a): return a
"""


@pytest.fixture
def file() -> ParsedFile:
    return parse_file("m.py", SOURCE, Path())


@pytest.mark.parametrize(
    ("line", "text", "known"),
    [
        (6, b"\t\tx = 2  # fi:0a\n", True),
        (9, b"\t\t\tx = 3  # fi:0a\n", True),
        (9, b"\t\t\tnonlocal y  # fi:0a\n", False),
        (6, b"\t\tx = (  # fi:0a\n", False),
        (6, b"\tx = 2  # fi:0a\n", False),
        (13, b"def f(a): return await a  # fi:0a\n", False),
        (13, b"def f(a): return -a  # fi:0a\n", True),
        (0, b"LIMIT = 2  # fi:0a\n", False),  # outside all functions, so not decided
    ],
)
def test_compiling_a_changed_function_shows_whether_the_file_compiles(
    file: ParsedFile, line: int, text: bytes, known: bool
) -> None:
    edits = [
        probe_import_edit(file, None),
        LineEdit(line_index=line, rank=EditRank.INSTEAD, lines=(text,)),
    ]
    assert certainly_compiles_for_key(file, edits, reuse_key(file, edits, ["0a"])) is known
