"""On thousands of sources, every mutant that the splicer does not refuse is correct. `pytest -m slow -n 2 -rP
tests/property/test_splicer_at_large.py` tries all and prints the figures."""

import random
import sysconfig
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import ModuleType

import libcst as cst
import pytest
from libcst.metadata import MetadataWrapper, PositionProvider

from mutator.mutants import function_statements, injection_edits, parsed_files_and_anchors, splicing
from mutator.mutants.parsed_files_and_anchors import parse_file

from .behaviour import behaviour
from .generated_modules import ModuleWriter
from .splicer_proofs import Figures, Run, Wrong, prove

LIBRARY = Path(sysconfig.get_path("stdlib"))
KINDS = ("entry", "after_assign", "before_assign", "after_call", "before_call", "before_return", "guard")


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def proved(sources: Iterable[tuple[object, bytes]], run: Run | None, variables: int = 3) -> Figures:
    figures = Figures()
    for name, data in sources:
        try:
            prove(data, figures, run, variables)
        except Wrong as error:
            figures.wrong.append(f"{name}: {error}")
    print(f"\n{figures}")
    return figures


# LibCST does not reproduce most of these
ODD_SOURCES = {
    "blank before a colon": (
        "def f(x):\n    try:\n        y = g(x)\n    except OSError :\n        y = 1\n    return y\n"
    ),
    "blanks around a colon": "def f(x) :\n    if x : y = 1\n    else :\n        y = g(x)\n    return y\n",
    "form feed before def": "def f(x):\n    return x\n\x0cdef g(x):\n    y = f(x)\n    return y\n",
    "form feed in the indentation": "def f(x):\n\x0c    y = g(x)\n    \x0c\n    z = y\n    return z\n",
    "form feed inside": "def f(x):\n    y =\x0cg(x)\n    g(\x0cx)\x0c\n    return\x0cy\n",
    "form feed before a class": (
        "class A:\n    def f(self):\n        x = 1\n\x0c    def g(self):\n        x = h(2)\n\x0cy = 3\n"
    ),
    "only a backslash": "\\\ndef f(x):\n    y = g(x)\n    \\\n    g(y)\n    \\\n    return y\n",
    "backslashes and other indentation": (
        "def f(x):\n    if x:\n        a = 1; \\\n    b = 2\n        \\\n  c = 3\n    return b\n"
    ),
    "backslash below the docstring": (
        "'Doc.'\n\\\nfrom __future__ import annotations\n\\\nx = 1\ndef f(x):\n    y = x\n"
    ),
    "backslash at the end": "def f(x):\n    y = x \\\n\n    g(y) \\\n\n",
    "blanks at the end": "def f(x):\n    y = x\n    return y\n\n  \n",
    "no end of line": "def f(x):\n    try:\n        return x\n    except E :\n        y = 1",
    "tabs": "def f(x):\n\ttry:\n\t\ty = g(x)\n\texcept E :\n\t  y = 1\n\treturn y\n",
    "CRLF and LF": (
        "def f(x):\r\n    try:\n        y = g(x)\r\n    except E :\r\n        y = 1\n    return y\r\n"
    ),
    "byte order mark": "\ufeffdef f(x):\n    y = g(x)\n    return y\n",
    "byte order mark and backslash": "\ufeff\\\ndef f(x): return x\ndef g(x):\n    y = f(x)\n    return y",
    "byte order mark, form feed": "\ufeff\x0cimport a\nx = 1\n\x0cdef f(x):\n    y = g(x)\n",
    "byte order mark and CRLF": "\ufeffclass A:\r\n    def f(self):\r\n        y = g(x)\r\n",
    "letters outside ASCII": (
        "def f(ä):\n    try:\n        ö = 'ü', g(ä)\n    except Ä :\n        ö = g('ß'); g(ä)\n    return ö\n"
    ),
}
PARTS = 8  # of a slow test, so that eight workers can share it


@pytest.mark.parametrize(
    ("first", "count"),
    [(0, 6), *(pytest.param(2500 * part, 2500, marks=pytest.mark.slow) for part in range(PARTS))],
)
def test_mutants_of_generated_modules_are_correct(first: int, count: int) -> None:
    seeds = range(first, first + count)
    figures = proved(((seed, ModuleWriter(seed).module()) for seed in seeds), behaviour)
    assert not figures.wrong
    assert figures.modules["spliced"] > 0.8 * count
    assert all(figures.anchors[kind] > count / 2 for kind in KINDS)


@pytest.mark.parametrize("name", ODD_SOURCES)
def test_mutants_of_files_with_odd_blanks_are_correct(name: str) -> None:
    figures = proved([(name, ODD_SOURCES[name].encode())], None)
    assert not figures.wrong
    assert figures.modules == {"spliced": 1} and figures.anchors.total()


@pytest.mark.parametrize("part", [None, *(pytest.param(n, marks=pytest.mark.slow) for n in range(PARTS))])
def test_mutants_of_the_standard_library_are_correct(part: int | None) -> None:
    paths = sorted(path for path in LIBRARY.rglob("*.py") if "site-packages" not in path.parts)
    chosen = random.Random(4).sample(paths, 4) if part is None else paths[part::PARTS]
    figures = proved(((path, path.read_bytes()) for path in chosen), None)
    assert not figures.wrong
    assert figures.modules["spliced"] > 0.95 * len(chosen)
    assert all(figures.anchors[kind] >= len(chosen) for kind in KINDS)


def test_a_seed_always_gives_the_same_module() -> None:
    assert ModuleWriter(7).module() == ModuleWriter(7).module() != ModuleWriter(8).module()


SHIFTED = b"x = 1\n\\\ndef f(a):\n    b = a\n    c = T(1, b)\n    return c\ncall(f, 1)\n"
CONTINUED = b"def f(a):\n    b = a; \\\n\n    return b\ncall(f, 1)\n"
READS = b"def f(a):\n    b = T(1, abs(a) + max(a, 1))\n    return b\ncall(f, 2)\n"


@pytest.mark.parametrize(
    ("place", "name", "source"),
    [
        (parsed_files_and_anchors, "parse_with_libcst", SHIFTED),
        (function_statements, "line_after_statements", CONTINUED),
        (injection_edits, "_check_keeps_name_scopes", READS),
        (splicing, "_indent_unit_of", READS),
    ],
)
def test_a_broken_splicer_is_found(
    place: ModuleType, name: str, source: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert not proved([("", source)], behaviour, 20).wrong
    broken = {
        "parse_with_libcst": without_check_of_bytes,
        "line_after_statements": lambda node, positions: positions[node].end.line,
        "_check_keeps_name_scopes": lambda *given: None,
        "_indent_unit_of": lambda *given: b"",
    }
    monkeypatch.setattr(place, name, broken[name])
    monkeypatch.setattr(parsed_files_and_anchors, "_check_position_matches_ast", lambda *given: None)
    parse_file.cache_clear()  # of what the sound splicer parsed
    try:
        assert proved([("", source)], behaviour, 20).wrong
    finally:
        parse_file.cache_clear()


def without_check_of_bytes(data: bytes, where: Path) -> object:
    module = cst.parse_module(data)
    return module, MetadataWrapper(module, unsafe_skip_copy=True).resolve(PositionProvider)
