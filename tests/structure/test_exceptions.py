"""Every exception of the harness stands in one tree, in `mutator/errors.py`."""

import ast
import builtins
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from mutator import errors

CLONE = Path(__file__).parents[2]
BUILT_IN = {
    name
    for name, value in vars(builtins).items()
    if isinstance(value, type) and issubclass(value, BaseException)
}
IN_TARGET = ("glue.py", "engines/in_target/")  # cannot import the harness


def exceptions_in(source: str) -> Iterator[ast.ClassDef]:
    """Classes that are exceptions by their bases: built-in ones, those of `errors`, those before them."""
    known = BUILT_IN | {name for name in vars(errors) if isinstance(getattr(errors, name), type)}
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ClassDef):
            bases = {ast.unparse(base).rpartition(".")[2] for base in node.bases}
            if bases & (known - {"Path", "Any"}):
                yield node


def when_and_remedy(docstring: str) -> tuple[str, str] | None:
    """When an exception is raised and what to do, if its docstring has a summary and both."""
    form = r"\w[^*]+\.\n\n\* When: (\w[^*]+\.)\n\* To do: (\w[^*]+\.)"
    found = re.match(form, docstring)
    return None if found is None else (found[1], found[2])


def test_no_other_module_defines_an_exception() -> None:
    strangers = [
        f"{path.relative_to(CLONE)}: {node.name}"
        for path in sorted((CLONE / "mutator").rglob("*.py"))
        if path.name != "errors.py"
        and not path.relative_to(CLONE / "mutator").as_posix().startswith(IN_TARGET)
        for node in exceptions_in(path.read_text(encoding="utf-8"))
    ]
    assert strangers == []


def test_a_planted_exception_would_be_noticed() -> None:
    planted = "class A(ValueError): ...\nclass B(errors.MutatorError): ...\nclass C(dict): ..."
    assert [node.name for node in exceptions_in(planted)] == ["A", "B"]


def test_each_says_when_and_what_to_do() -> None:
    source = (CLONE / "mutator" / "errors.py").read_text()
    texts = {node.name: ast.get_docstring(node) or "" for node in exceptions_in(source)}
    assert len(texts) >= 25
    assert [name for name, text in texts.items() if when_and_remedy(text) is None] == []
    cases = [when_and_remedy(text) for text in texts.values()]
    assert len({when for when, _ in filter(None, cases)}) == len(texts)


@pytest.mark.parametrize(
    "text",
    [
        "The machine is out of a resource. Finished work is kept: run the same command again.",
        "The disk is full.\n\n* When: a file cannot be written.",
        "The disk is full.\n\n* To do: free space.",
        "The disk is full.\n\n* When: .\n* To do: free space.",
        "The disk is full.\n\n* When: a file cannot be written.\n* To do:",
        "* When: a file cannot be written.\n* To do: free space.",
    ],
)
def test_a_docstring_without_one_of_the_two_is_noticed(text: str) -> None:
    assert when_and_remedy(text) is None
