"""Splicing lines into sources of many forms."""

from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.model import Anchor, AnchorKind, FaultLocation
from mutator.mutants import splicing
from mutator.mutants.parsed_files_and_anchors import ParsedFile, parse_file

CODE = ('if _fi.active("ab12"):', "    x = x + 1.0")
GUARD = ('if not _fi.active("ab12"):',)


def parsed(text: str | bytes) -> ParsedFile:
    return parse_file("m.py", text if isinstance(text, bytes) else text.encode(), Path("root"))


def edit(
    file: ParsedFile, kind: AnchorKind, name: str = "x", *, guard: bool = False, nth: int | None = None
) -> splicing.LineEdit:
    location = FaultLocation(path="m.py", function="f", anchor=Anchor(kind=kind, name=name, nth=nth))
    make, code = (splicing.guard_edit, GUARD) if guard else (splicing.insertion_edit, CODE)
    return make(file, file.resolve_statement(location), code, "ab12")


def spliced(text: str | bytes, kind: AnchorKind, name: str = "x", *, guard: bool = False) -> bytes:
    """Return the mutated bytes, after checking that they compile and that the original can be restored."""
    file = parsed(text)
    result = splicing.mutated_bytes(splicing.apply_edits(file, [edit(file, kind, name, guard=guard)]))
    compile(result, "m.py", "exec")
    assert splicing.unsplice(result) == file.data
    return result


def test_lines_are_inserted_next_to_the_statement() -> None:
    text = "def f(x):\n    # why\n    x = 1  # set\n    # then\n    return x\n"
    assert spliced(text, AnchorKind.AFTER_ASSIGN).decode() == (
        "def f(x):\n    # why\n    x = 1  # set\n"
        '    if _fi.active("ab12"):  # fi:ab12\n        x = x + 1.0  # fi:ab12\n'
        "    # then\n    return x\n"
    )
    assert spliced(text, AnchorKind.BEFORE_RETURN).decode() == (
        "def f(x):\n    # why\n    x = 1  # set\n    # then\n"
        '    if _fi.active("ab12"):  # fi:ab12\n        x = x + 1.0  # fi:ab12\n'
        "    return x\n"
    )


@pytest.mark.parametrize(
    "text",
    [
        pytest.param("def f(x):\r\n    x = 1\r\n    return x\r\n", id="CRLF"),
        pytest.param("def f(x):\n    x = 1", id="no newline at the end"),
        pytest.param("def f(x):\r\n    x = 1", id="CRLF, no newline at the end"),
        pytest.param("def f(x):\n\tif x:\n\t\tx = 1\n\treturn x\n", id="tabs"),
        pytest.param("def f(x):\n  if x:\n  \tx = 1\n  return x\n", id="spaces, then tabs"),
        pytest.param("def f(x):\n  x = 1\n  return x\n", id="two spaces"),
        pytest.param("def f(x):\n    x = (1 +\n 2\n    )  # why\n    return x\n", id="brackets over lines"),
        pytest.param("def f(x):\n    x = 1 + \\\n  2\n    return x\n", id="backslash"),
        pytest.param("def f(x):\n    x = 1 \\\n\n    return x\n", id="backslash at the end"),
        pytest.param('def f(x):\n    x = """a\nb\n  """\n    return x\n', id="string over lines"),
        pytest.param("def f(x):\n    y = 2; x = 1\n    return x\n", id="last after a semicolon"),
        pytest.param("def f(x):\n    x = 1;\n    return x\n", id="a semicolon too many"),
        pytest.param("@d\n@e(1)\nasync def f(x):\n    x = await g()\n    return x\n", id="decorated, async"),
        pytest.param("def f(x):\n    try:\n        x = 1\n    finally:\n        pass\n", id="in try"),
        pytest.param("def f(x):\n    if 1:\n        x = 1\n    else:\n        pass\n", id="before else"),
        pytest.param("def f(x):\n    match x:\n        case 1:\n            x = 1\n", id="in match"),
        pytest.param("def f(x):\n    x = 1\n\x0c\n    return x\n", id="form feed"),
        pytest.param(
            "# -*- coding: latin-1 -*-\ndef f(x):\n    x = '\xe9'\n".encode("latin-1"), id="latin-1"
        ),
        pytest.param(b"\xef\xbb\xbfdef f(x):\n    x = 1\n", id="byte order mark"),
        pytest.param("def f(x):\n    x = 'a\x0bb\x1cc\x85d\u2028e'\n    return x\n", id="odd separators"),
        pytest.param("def f(x):\n    x = 1\n    \n", id="blank line with spaces"),
    ],
)
def test_inserting_changes_no_other_line(text: str | bytes) -> None:
    result = spliced(text, AnchorKind.AFTER_ASSIGN)
    data = text if isinstance(text, bytes) else text.encode()
    added = [line for line in result.splitlines() if b"fi:ab12" in line]
    assert len(added) == 2
    assert added[0].endswith(b'if _fi.active("ab12"):  # fi:ab12')
    assert sorted(set(result.splitlines()) - set(added)) == sorted(set(data.splitlines()))
    assert (b"\r\n" in data) == (b"# fi:ab12\r\n" in result)
    assert result.endswith((b"\n", b"\r")) == data.endswith((b"\n", b"\r"))


def test_a_guard_indents_the_statement_it_wraps() -> None:
    text = "def f(x):\n    g(\n        1,\n\n  2)  # why\n    return x\n"
    assert spliced(text, AnchorKind.BEFORE_CALL, "g", guard=True).decode() == (
        'def f(x):\n    if not _fi.active("ab12"):  # fi:ab12 guard:4\n'
        "        g(\n            1,\n\n      2)  # why\n    return x\n"
    )


def test_a_guard_does_not_indent_the_inside_of_a_string() -> None:
    """Indenting the lines of a string would change the string."""
    text = 'def f(x):\n    g("""a\n    b""", f"""{x}\n""")\n'
    assert spliced(text, AnchorKind.BEFORE_CALL, "g", guard=True).decode() == (
        'def f(x):\n    if not _fi.active("ab12"):  # fi:ab12 guard:1\n'
        '        g("""a\n    b""", f"""{x}\n""")\n'
    )


@pytest.mark.parametrize(
    "text",
    [
        "def f(x):\n\tg(1,\n\t  2)\n",
        "def f(x):\n  if x:\n  \tg(1)\n",
        "def f(x):\r\n    g(1)",
        "def f(x):\n    g(1, \\\n 2)\n",
        "def f(x):\n    x = g(1)\n",
        "def f(x):\n    return g(1)\n",
    ],
)
def test_guards_can_be_undone_in_files_of_every_form(text: str) -> None:
    assert b"guard:" in spliced(text, AnchorKind.BEFORE_CALL, "g", guard=True)


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("def f(x):\n    a(); g(1)\n", AnchorKind.AFTER_CALL),
        ("def f(x):\n    g(1); a()\n", AnchorKind.BEFORE_CALL),
        ("def f(x):\n    g(1)\n", AnchorKind.AFTER_CALL),
        ("def f(x):\n    g(1)\n", AnchorKind.ENTRY),
    ],
)
def test_only_a_statement_alone_on_its_lines_can_be_wrapped(text: str, kind: AnchorKind) -> None:
    file = parsed(text)
    with pytest.raises(MutatorError, match="a guard needs a statement that is alone"):
        edit(file, kind, "" if kind is AnchorKind.ENTRY else "g", guard=True)


def test_several_edits_at_one_statement_can_be_combined() -> None:
    file = parsed("def f(x):\n    if x:\n        x = 1\n    g(1)\n    return x\n")
    edits = [
        edit(file, AnchorKind.BEFORE_CALL, "g", guard=True),
        edit(file, AnchorKind.BEFORE_CALL, "g"),
        edit(file, AnchorKind.AFTER_ASSIGN),
        edit(file, AnchorKind.AFTER_CALL, "g"),
    ]
    result = splicing.mutated_bytes(splicing.apply_edits(file, edits))
    compile(result, "m.py", "exec")
    assert splicing.unsplice(result) == file.data
    margins = [len(line) - len(line.lstrip()) for line in result.decode().splitlines()[3:]]
    assert margins == [8, 12, 4, 8, 4, 8, 4, 8, 4]
    assert b"guard:1\n        g(1)\n" in result


def test_two_guards_around_one_statement_are_refused() -> None:
    file = parsed("def f(x):\n    g(1)\n")
    guard = edit(file, AnchorKind.BEFORE_CALL, "g", guard=True)
    with pytest.raises(MutatorError, match="two guards around one statement"):
        splicing.apply_edits(file, [guard, guard])


def test_two_edits_at_the_end_of_a_file_without_a_newline_can_be_undone() -> None:
    file = parsed("def f(x):\n    x = g(1)")
    edits = [edit(file, AnchorKind.AFTER_ASSIGN), edit(file, AnchorKind.AFTER_CALL, "g")]
    result = splicing.mutated_bytes(splicing.apply_edits(file, edits))
    assert result.count(b"# fi:ab12\n") == 3 and result.endswith(b"# fi:ab12")
    assert splicing.unsplice(result) == file.data


def test_a_snippet_that_the_files_encoding_cannot_represent_is_refused() -> None:
    file = parsed("# coding: ascii\ndef f(x):\n    x = 1\n")
    site = file.resolve_statement(
        FaultLocation(path="m.py", function="f", anchor=Anchor(kind=AnchorKind.AFTER_ASSIGN, name="x"))
    )
    with pytest.raises(MutatorError, match=r":\d+: .* cannot be encoded in ascii"):
        splicing.insertion_edit(file, site, ["gr\xf6\xdfe = 1"], "ab12")


def test_the_import_of_the_probe_is_tagged() -> None:
    file = parsed('"""Doc."""\nfrom __future__ import annotations\n\nimport os\n')
    result = splicing.mutated_bytes(splicing.apply_edits(file, [splicing.probe_import_edit(file, "pack")]))
    assert result.decode() == (
        '"""Doc."""\nfrom __future__ import annotations\nfrom pack import _fi  # fi:probe\n\nimport os\n'
    )


def test_a_byte_order_mark_stays_first() -> None:
    file = parsed(b"\xef\xbb\xbf'Doc.'\nx = 1\n")
    result = splicing.mutated_bytes(splicing.apply_edits(file, [splicing.probe_import_edit(file, "pack")]))
    compile(result, "m.py", "exec")
    assert result.startswith(b"\xef\xbb\xbf'Doc.'\nfrom pack")


@pytest.mark.parametrize(
    "text",
    [
        "import a\n\ndef f(x):\n    x = 1\n",
        "def f(x): return x\ndef g(x):\n    x = 1",
        "import a",
        "\x0cx = 1\n",
    ],
)
def test_an_import_before_the_first_statement_comes_after_the_byte_order_mark(text: str) -> None:
    file = parsed(b"\xef\xbb\xbf" + text.encode())
    pieces = splicing.apply_edits(file, [splicing.probe_import_edit(file, "pack")])
    result = splicing.mutated_bytes(pieces)
    compile(result, "m.py", "exec")
    assert result == b"\xef\xbb\xbffrom pack import _fi  # fi:probe\n" + text.encode()
    assert b"".join(line for piece in pieces if piece.sign != "+" for line in piece.lines) == file.data
    assert splicing.unsplice(result) == file.data
