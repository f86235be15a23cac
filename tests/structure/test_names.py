"""The harness serves any controller, so it contains no car names."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCES = Path(__file__).parents[2] / "mutator"
# `new_library.md` accompanies copies of the shipped library
EXEMPT = {"paper", "new_library.md"}
CARS = re.compile(
    r"(?<![a-z0-9])(d_rel|v_ego|v_lead|hwt|gas|brake|h[123]|lanes?|radars?|chaff|lead)(?![a-z0-9])", re.I
)
HUMP = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")  # between words of CamelCase
OTHERS = re.compile(r"</?h[123]\b|\blead(s|ing)? (to|nowhere)\b")  # headings, and the verb
HEADINGS = re.compile(r"\"h[123]\"|\bh[123](?=[ ,:{])")  # in scripts and style sheets


def words(tree: ast.AST) -> Iterator[tuple[int, str]]:
    for node in ast.walk(tree):
        line = getattr(node, "lineno", 0)
        for field in ("id", "attr", "arg", "name", "asname", "module", "value"):
            text = getattr(node, field, None)
            if isinstance(text, str):
                yield line, text


def found(code: str, suffix: str = ".py") -> list[tuple[int, str]]:
    if suffix == ".py":
        texts = [(line, text) for line, text in words(ast.parse(code)) if "\nExamples:" not in text]
    else:
        texts = list(enumerate(HEADINGS.sub("", code).splitlines(), 1))
    return [(line, text[:80]) for line, text in texts if CARS.search(HUMP.sub("_", OTHERS.sub("", text)))]


@pytest.mark.parametrize(
    "code",
    [
        "lead_d_rel = 1",
        "f(gas=1)",
        "x = 'S1 with H1'",
        "import radar",
        "a.v_ego",
        "class RadarSensor: ...",
        "leftLane = 1",
        "x = 'at Camera.aRADARPoint'",
    ],
)
def test_car_names_of_any_spelling_are_found(code: str) -> None:
    assert found(code)


@pytest.mark.parametrize("line", ["// #kind=radar%2Fchaff", "<p>no lane</p>", "const gasMax = 1;"])
def test_car_names_are_found_in_pages_scripts_and_templates(line: str) -> None:
    assert found(line, ".js")


def test_the_harness_has_no_car_names() -> None:
    """Only the manifest says what a target observes, records and judges."""
    paths = [
        path
        for path in SOURCES.rglob("*.*")
        if path.is_file() and path.suffix != ".pyc" and not EXEMPT & {*path.relative_to(SOURCES).parts}
    ]
    assert {path.suffix for path in paths} >= {".py", ".js", ".html", ".css", ".j2"}
    assert {str(path): names for path in paths if (names := found(path.read_text(), path.suffix))} == {}
