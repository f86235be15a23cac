"""The harness is for any controller: it knows the names of none."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCES = Path(__file__).parents[2] / "mutator"
# `upgrade.py` reads manifests of the time when every target observed the same four values
EXEMPT = {"paper", "upgrade.py"}
CARS = re.compile(
    r"(?<![a-z0-9])(d_rel|v_ego|v_lead|hwt|gas|brake|h[123]|lanes?|radar|lead)(?![a-z0-9])", re.I
)
HUMP = re.compile(r"(?<=[a-z])(?=[A-Z])")  # of CamelCase
OTHERS = re.compile(r"</?h[123]>|\blead (to|nowhere)\b")  # headings, and the verb


def words(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Line and text of each identifier and string."""
    for node in ast.walk(tree):
        line = getattr(node, "lineno", 0)
        for field in ("id", "attr", "arg", "name", "asname", "module", "value"):
            text = getattr(node, field, None)
            if isinstance(text, str):
                yield line, text


def found(code: str) -> list[tuple[int, str]]:
    """Names of a car's in identifiers and strings, help examples apart."""
    texts = [
        (line, OTHERS.sub("", text)) for line, text in words(ast.parse(code)) if "\nExamples:" not in text
    ]
    return [(line, text[:80]) for line, text in texts if CARS.search(HUMP.sub(" ", text))]


@pytest.mark.parametrize(
    "code", ["lead_d_rel = 1", "f(gas=1)", "x = 'S1 with H1'", "import radar", "a.v_ego", "'RadarSensor'"]
)
def test_a_name_of_a_car_is_found(code: str) -> None:
    """Identifiers and strings are both read."""
    assert found(code)


def test_the_harness_has_no_names_of_a_car() -> None:
    """What a target observes, records and judges is told by its manifest alone."""
    paths = [path for path in SOURCES.rglob("*.py") if not EXEMPT & {*path.relative_to(SOURCES).parts}]
    assert {str(path): names for path in paths if (names := found(path.read_text()))} == {}


def test_pages_have_no_names_of_a_car() -> None:
    """Scripts, styles and templates of pages are for any target, too."""
    kinds = (".js", ".css", ".html", ".j2")
    paths = [path for path in SOURCES.rglob("*") if path.suffix in kinds and "paper" not in path.parts]
    texts = {path: HUMP.sub(" ", OTHERS.sub("", path.read_text())) for path in paths}
    heading = re.compile(r"\bh[123]\b")  # of HTML, in styles and scripts
    assert [path.name for path, text in texts.items() if CARS.search(heading.sub("", text))] == []
