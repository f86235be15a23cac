"""A file is refused if Python or LibCST cannot read it, or if LibCST does not reproduce all of it."""

import sys
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.mutants.anchors import parse_file

BODY = "def f(x):\n    x = 1\n    return x\n"


@pytest.mark.parametrize(
    ("source", "line", "said"),
    [
        ("\\\n" + BODY, 1, "LibCST does not reproduce the line `\\`"),
        (
            "def f(x):\n    x = 1\n    \\\n    y = 2\n    return x\n",
            3,
            "LibCST does not reproduce the line `\\`",
        ),
        ("def f(x):\r\n    x = 1\r\n\\\r\n    return x\r\n", 3, "LibCST does not reproduce the line `\\`"),
        ("# coding: latin-1\nx = '\xe9'\n\n\\\n" + BODY, 4, "LibCST does not reproduce the line `\\`"),
        (BODY + "try:\n    f(1)\nexcept OSError :\n    pass\n", 6, "the line `except OSError :`"),
        (BODY + "\n  \n", 4, "LibCST does not reproduce the line ``"),
        (BODY + "\n\x0cdef g(): pass\n", 5, "the line `def g(): pass`"),
        ("def f(x):\n    (x): int = 1\n", 2, "LibCST cannot parse this file: parser error"),
        (
            "x = 1\ny = (" + "1 + " * 400 + "1)\n",
            None,
            "LibCST cannot parse this file: maximum recursion depth",
        ),
        ("x = 1\ny = 2\rz = 3\n", 2, "a line ends in CR alone"),
        ("x = 1\ndef f(:\n", 2, "not valid Python"),
        ("x = 1\nreturn\n", 2, "not valid Python: 'return' outside function"),
    ],
)
def test_unreadable_files_are_refused(source: str, line: int | None, said: str) -> None:
    with pytest.raises(MutatorError) as caught:
        parse_file("m.py", source.encode("latin-1" if "latin" in source else "utf-8"), Path("root"))
    error = caught.value
    assert said in error.got
    assert (error.where, error.line) == ("root/m.py", line)
    assert error.remedy


@pytest.mark.skipif(sys.version_info >= (3, 14), reason="this Python has t-strings")
def test_syntax_of_a_newer_python_is_refused_with_its_line() -> None:
    with pytest.raises(MutatorError, match=r"m\.py:2: not valid Python: .*the Python that it is written for"):
        parse_file("m.py", b'x = 1\ny = t"{x}"\n', Path())


@pytest.mark.parametrize(
    "source",
    [
        "\ufeff" + BODY,
        BODY.replace("\n", "\r\n"),
        BODY.replace("x = 1", "x = 1; \\\n"),
        BODY + "\x0c\n" + BODY,
        BODY + "try:\n    f(1)\nexcept (OSError, ValueError) as e :\n    pass\n",
        "def f(x):\n    x = 1\n    \n\n",
        "",
    ],
)
def test_unusual_files_are_accepted(source: str) -> None:
    """LibCST preserves byte order marks, CRLF, line continuations, form feeds and unusual spaces."""
    assert parse_file("m.py", source.encode(), Path("root")).data == source.encode()
