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

from mutator.mutants import anchors, injection_edits, splicing, statements

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
        (anchors, "parse_with_libcst", SHIFTED),
        (statements, "line_after_statements", CONTINUED),
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
    monkeypatch.setattr(anchors, "_check_position_matches_ast", lambda *given: None)
    assert proved([("", source)], behaviour, 20).wrong


def without_check_of_bytes(data: bytes, where: Path) -> object:
    module = cst.parse_module(data)
    return module, MetadataWrapper(module, unsafe_skip_copy=True).resolve(PositionProvider)
