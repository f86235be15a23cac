"""Rendering: values become literals, names are checked, templates cannot reach out."""

from dataclasses import replace
from pathlib import Path

import pytest

from mutator.config.yaml_files import Source
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModel, ParamSchema, SnippetKind
from mutator.model import Value
from mutator.mutants.rendering import snippet

SOURCE = Source(path=Path("t.yaml"), data={}, lines={})


def model(template: str, kind: SnippetKind = SnippetKind.INSERT) -> FaultModel:
    return FaultModel(
        name="t",
        kind=kind,
        about="",
        params=(
            ParamSchema(name="target", type="variable", about=""),
            ParamSchema(name="by", type="number", about="", optional=True),
        ),
        examples=(),
        template=template,
        source=SOURCE,
        template_path=Path("t.py.j2"),
    )


def rendered(template: str, kind: SnippetKind = SnippetKind.INSERT, **params: Value) -> tuple[str, ...]:
    return snippet(model(template, kind), {"target": "x", "by": 1.0, **params}, "ab12")


@pytest.mark.parametrize(
    ("value", "plain", "added"),
    [
        (35.0, "35.0", "+ 35.0"),
        (-35.0, "-35.0", "- 35.0"),
        (0.1 + 0.2, "0.30000000000000004", "+ 0.30000000000000004"),
        (-0.0, "-0.0", "- 0.0"),
        (1e300, "1e+300", "+ 1e+300"),
        (float("nan"), "float('nan')", "+ float('nan')"),
        (float("inf"), "float('inf')", "+ float('inf')"),
        (float("-inf"), "float('-inf')", "- float('inf')"),
        (7, "7", "+ 7"),
        (True, "True", "+ True"),
    ],
)
def test_values_are_literals(value: float, plain: str, added: str) -> None:
    """Numbers are written exactly, non-finite ones so that Python understands them."""
    assert rendered("{{ target }} = {{ by }}\n", by=value) == (f"x = {plain}",)
    assert rendered("{{ target }} = y {{ by | signed }}\n", by=value) == (f"x = y {added}",)


@pytest.mark.parametrize(
    "name", ["x y", "x;y", "import", "x.class", "1x", "", "_fi.active", "x\ny", 3.0, None]
)
def test_names_are_checked(name: Value) -> None:
    """Only chains of identifiers get in where a variable is meant."""
    with pytest.raises(MutatorError):
        rendered("{{ target }} = 1\n", target=name)


@pytest.mark.parametrize("name", ["os;x", "a.b c", "a..b", ".a", "a.import", 1, None])
def test_imported_names_are_checked(name: Value) -> None:
    """What is to be imported is a chain of identifiers too."""
    imports = ParamSchema(name="what", type="import", about="")
    made = replace(model("from {{ what }} import x\n"), params=(imports,))
    assert snippet(made, {"what": "a.b"}, "ab12") == ("from a.b import x",)
    with pytest.raises(MutatorError):
        snippet(made, {"what": name}, "ab12")


def test_text_is_no_number() -> None:
    """A number's place takes no text, not even a harmless name."""
    with pytest.raises(MutatorError, match="'os' for 'by'; expected a number"):
        rendered("{{ target }} = {{ by }}\n", by="os")


@pytest.mark.parametrize(
    ("template", "pieces"),
    [
        ("{{ target = 1\n", ["t.py.j2:1: ", "expected token"]),
        ("x = 1\n{% if by %}\nx = 2\n", ["t.py.j2:3: ", "end of template"]),
        ("x = 1\nx = {{ bye }}\n", ["t.py.j2:2: ", "'bye' is undefined"]),
        ("x = {{ ''.__class__.__mro__ }}\n", ["t.py.j2:1: ", "unsafe"]),
        ("x = {{ target.__class__ }}\n", ["t.py.j2:1: ", "unsafe"]),
        ("x = {{ by / 0 }}\n", ["t.py.j2:1: ", "ZeroDivisionError"]),
        ("{% for i in range(1000000) %}x = 1\n{% endfor %}", ["t.py.j2:1: ", "Range too big"]),
        ("x = 1\nx = {{ 9 ** 9 ** 9 }}\n", ["t.py.j2:2: ", "** in a template"]),
        ("x = {{ 'a' * 10 ** 15 }}\n", ["t.py.j2:1: "]),
        ("x = {{ 'a' * 1000000000000000 }}\n", ["t.py.j2:1: ", "MemoryError"]),
        ("{% macro m() %}{{ m() }}{% endmacro %}{{ m() }}\n", ["t.py.j2:1: ", "RecursionError"]),
        ("x = {{ [1] }}\n", ["a list in a template"]),
        ("x = (\n", ["does not give Python"]),
        ("x = (1,\n    2)\n", ["one statement a line"]),
        ('x = """a\n    b"""\n', ["one statement a line"]),
        ("x = 1 + \\\n    2\n", ["one statement a line"]),
        ("x = 1\n\nx = 2\n", ["one statement a line"]),
        ("# why\nx = 1\n", ["one statement a line"]),
        ("if x:\n  x = 1\n", ["one statement a line"]),
        ("if x:\n\tx = 1\n", ["one statement a line"]),
        ("if x:\n", ["does not give Python"]),
        ("if x:\n    yield x\n", ["t.py.j2: the template yields"]),
        ("x = yield from x\n", ["t.py.j2: the template yields"]),
        ("", ["one statement a line"]),
    ],
)
def test_a_template_that_fails(template: str, pieces: list[str]) -> None:
    """The error names the template, its line where there is one, and the reason."""
    with pytest.raises(MutatorError) as caught:
        rendered(template)
    for piece in pieces:
        assert piece in str(caught.value)


def test_a_guard_opens_a_block() -> None:
    """The last line of a guard must be ready to take a statement beneath it."""
    assert rendered("if not {{ target }}:\n", SnippetKind.GUARD) == ("if not x:",)
    with pytest.raises(MutatorError, match="a guard's last line must open a block"):
        rendered("x = 1\n", SnippetKind.GUARD)
