"""LibCST and `ast` must agree on the place of a statement, or the statement cannot be an anchor."""

import ast
from pathlib import Path

import libcst as cst
import pytest
from libcst.metadata import MetadataWrapper, PositionProvider

from mutator.errors import MutatorError
from mutator.model import Anchor, AnchorKind, FaultLocation
from mutator.mutants.parsed_files_and_anchors import ParsedFile, parse_file
from mutator.mutants.positions_of_both_parsers import NodePosition, ast_node_positions, line_after_statements

SOURCE = '''\
@deco
async def größe(µ):
    """Doc."""
    µ = ("ö", [
        µ]); x: int = 1
    (µ.f(1))
    if µ:  x += 1
    return  (x)
def plain(x): return x
'''


def parsed(source: str = SOURCE) -> ParsedFile:
    return parse_file("m.py", source.encode(), Path("root"))


def test_both_parsers_agree_on_places() -> None:
    file = parsed()
    told = [f.position for functions in file.functions_by_name.values() for f in functions]
    told += [
        s.position
        for functions in file.functions_by_name.values()
        for f in functions
        for s in f.statements
        if s.position
    ]
    assert {place.with_byte_columns(file.lines, file.encoding) for place in told} == {
        place for place in file.ast_positions if place.node_class != "Expr" or place.start[0] != 3
    }
    assert (
        NodePosition(node_class="AsyncFunctionDef", start=(2, 0), end=(3, 4), has_docstring=True)
        in file.ast_positions
    )
    assert NodePosition(node_class="AnnAssign", start=(5, 14), end=(5, 24)) in file.ast_positions


@pytest.mark.parametrize("kind", [AnchorKind.AFTER_ASSIGN, AnchorKind.BEFORE_RETURN, AnchorKind.ENTRY])
def test_a_statement_that_the_parsers_place_on_different_lines_is_refused(
    kind: AnchorKind, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The test makes `ast` find the anchored statement one line further down."""
    later = ast_node_positions(ast.parse("\ndef f(x):\n    x = 1\n    return x\n"))
    monkeypatch.setattr("mutator.mutants.parsed_files_and_anchors.ast_node_positions", lambda tree: later)
    file = parsed("def f(x):\n    x = 1\n    return x\n")
    name = "" if kind is AnchorKind.ENTRY else "x"
    location = FaultLocation(path="m.py", function="f", anchor=Anchor(kind=kind, name=name))
    with pytest.raises(MutatorError, match=r"root/m.py:\d: LibCST and Python's own parser") as caught:
        file.resolve_statement(location)
    assert caught.value.line == {"after_assign": 2, "before_return": 3, "entry": 1}[kind]


def test_comparing_places_detects_a_line_that_libcst_loses(monkeypatch: pytest.MonkeyPatch) -> None:
    """The test turns off the check that LibCST reproduces the file's bytes."""

    def unchecked(data: bytes, where: Path) -> object:
        module = cst.parse_module(data)
        return module, MetadataWrapper(module, unsafe_skip_copy=True).resolve(PositionProvider)

    monkeypatch.setattr("mutator.mutants.parsed_files_and_anchors.parse_with_libcst", unchecked)
    file = parsed("x = 0\n\\\ndef f(x):\n    x = 1\n    y = 2\n")
    location = FaultLocation(path="m.py", function="f", anchor=Anchor(kind=AnchorKind.AFTER_ASSIGN, name="x"))
    with pytest.raises(MutatorError, match=r"LibCST and Python's own parser"):
        file.resolve_statement(location)


@pytest.mark.parametrize(
    ("line", "after"),
    [
        ("x = 1", 1),
        ("x = 1 \\\n", 2),
        ("x = 1; \\\n", 2),
        ("x = 1 \\\n; \\\n", 3),
        ("x = 1; y = 2 \\\n  ;", 2),
        ("x = (1,\n 2) # \\", 2),
    ],
)
def test_backslashes_extend_the_last_statement(line: str, after: int) -> None:
    module = cst.parse_module(line + "\n")
    positions = MetadataWrapper(module, unsafe_skip_copy=True).resolve(PositionProvider)
    first = module.body[0]
    assert isinstance(first, cst.SimpleStatementLine)
    assert line_after_statements(first, positions) == after
