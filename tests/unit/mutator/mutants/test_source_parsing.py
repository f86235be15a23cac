"""A file is refused if Python or LibCST cannot read it."""

import re
import sys
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.mutants.parsed_files_and_anchors import parse_file

BODY = "def f(x):\n    x = 1\n    return x\n"


@pytest.mark.parametrize(
    ("source", "line", "said"),
    [
        ("def f(x):\n    (x): int = 1\n", 2, "LibCST cannot parse this file: parser error"),
        (
            "class A:\n    def f(self):\n        (self.x): int = 1\n\n# end\n",
            3,
            "LibCST cannot parse this file",
        ),
        ("def f(x):\n    \\\n    return x\n", 3, "LibCST cannot parse this file"),
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


@pytest.mark.parametrize(
    "statement",
    [
        "return a if b else(lambda: a + 1)()",
        "return(lambda: a)",
        "return((lambda: a))",
        "assert(lambda: a)()",
        "c = a in(lambda: b)()",
        "if(lambda: a)(): pass",
        "c = not(lambda: a)()",
        "c = a and(lambda: b)",
        "yield(lambda: a)",
        "yield from(lambda: a)()",
        "for c in(lambda: a)(): pass",
        "raise E from(lambda: a)()",
        "c = [d for d in a if(lambda: d)()]",
    ],
)
def test_a_lambda_right_after_a_keyword_is_refused_with_its_line(statement: str) -> None:
    """LibCST raises TypeError for these, which are valid Python."""
    source = f"def f(a, b):\n    c = 'else(lambda: 1)'\n    {statement}\n"
    with pytest.raises(MutatorError, match=r"m\.py:3: .*`lambda` in parentheses right after a keyword"):
        parse_file("m.py", source.encode(), Path())
    spaced = re.sub(r"(\w)(\(+lambda)", r"\1 \2", source)
    assert parse_file("m.py", spaced.encode(), Path())


def test_a_failure_of_libcst_names_no_cause_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> object:
        raise TypeError("another cause")

    monkeypatch.setattr("mutator.mutants.source_parsing.cst.parse_module", fail)
    for source in (BODY, "x = 1 if 2 else(lambda: 1)\n"):
        with pytest.raises(MutatorError, match=r"^m\.py: LibCST cannot parse this file: another cause;"):
            parse_file("m.py", source.encode(), Path())


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
        BODY + "try:\n    f(1)\nexcept OSError :\n    pass\n",
        BODY + "\n\x0cdef g(): pass\n",
        "\\\n" + BODY,
    ],
)
def test_unusual_files_are_accepted(source: str) -> None:
    assert parse_file("m.py", source.encode(), Path("root")).data == source.encode()
