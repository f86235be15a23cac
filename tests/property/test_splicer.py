"""On generated sources, unsplicing restores every byte, and splicing equals an insertion by LibCST."""

import ast
from collections.abc import Sequence
from pathlib import Path

import libcst as cst
from hypothesis import given, settings
from hypothesis import strategies as st

from mutator.model import Anchor, AnchorKind, FaultLocation
from mutator.mutants import splicing
from mutator.mutants.parsed_files_and_anchors import parse_file

INSERTED = ('if _fi.active("ab12"):', "    hit = hit - 35.0", "    hit = max(hit, 0.0)")
GUARD = ('if not _fi.active("cd34"):',)
UNITS = st.sampled_from(["    ", "  ", "\t"])
NEWLINES = st.sampled_from(["\n", "\r\n"])


@st.composite
def sources(draw: st.DrawFn) -> tuple[bytes, list[str]]:
    """Draw a module with one function `f` of random shape, and the names that it assigns, once each."""
    unit, newline = draw(UNITS), draw(NEWLINES)
    names: list[str] = []
    head = draw(st.lists(st.sampled_from(['"""Doc."""', "# note", "import os", ""]), max_size=3))
    decorators = draw(st.lists(st.sampled_from(["@d", "@d(", "# why"]), max_size=2))
    lines = [*head, *(f"{d}1)" if d.endswith("(") else d for d in decorators)]
    lines.append(draw(st.sampled_from(["def f(x):", "async def f(", "def f(x):  # go"])))
    if lines[-1].endswith("("):
        lines.append(f"{unit}x):")
    lines += draw(blocks(unit, unit, names, depth=0))
    if draw(st.booleans()):
        lines += ["", "def g():", f"{unit}return 1"]
    end = "" if draw(st.booleans()) else newline
    return (newline.join(lines) + end).encode(), names


@st.composite
def blocks(draw: st.DrawFn, indent: str, unit: str, names: list[str], depth: int) -> list[str]:
    lines: list[str] = []
    for _ in range(draw(st.integers(1, 3))):
        kinds = ["plain", "multi", "text", "slash", "ann", "tuple", "last"]
        kind = draw(st.sampled_from(kinds + (["block", "try", "def"] if depth < 2 else [])))
        if kind in ("block", "try", "def"):
            inner: list[str] = [] if kind == "def" else names
            body = draw(blocks(indent + unit, unit, inner, depth + 1))
            opening = {"block": "if x:", "try": "try:", "def": f"def g{len(lines)}():"}[kind]
            lines += [indent + opening, *body]
            if kind == "try":
                lines += [f"{indent}finally:", f"{indent}{unit}pass"]
            continue
        name = f"v{len(names)}"
        names.append(name)
        lines += [indent + line for line in draw(st.lists(st.sampled_from(["# note", ""]), max_size=1))]
        lines += {
            "plain": [f"{indent}{name} = 1  # set"],
            "multi": [f"{indent}{name} = (", "  1,", "", f"{indent}  # mid", f"{indent})"],
            "text": [f'{indent}{name} = """a', "b  # fi", f'{unit}"""'],
            "slash": [f"{indent}{name} = 1 + \\", "   2"],
            "ann": [f"{indent}{name}: int = 1;"],
            "tuple": [f"{indent}{name}, other = x, 1"],
            "last": [f"{indent}pass; {name} = x"],
        }[kind]
    return lines


def site(name: str, kind: AnchorKind) -> FaultLocation:
    return FaultLocation(path="m.py", function="f", anchor=Anchor(kind=kind, name=name))


class Direct(cst.CSTTransformer):
    """The same mutation, applied to LibCST's tree."""

    def __init__(self, after: set[str], guarded: set[str]) -> None:
        super().__init__()
        self.after = after
        self.guarded = guarded
        self.functions: list[str] = []

    def visit_FunctionDef(self, node: cst.FunctionDef) -> None:  # noqa: N802
        self.functions.append(node.name.value)

    def leave_FunctionDef(  # noqa: N802
        self, original_node: cst.FunctionDef, updated_node: cst.FunctionDef
    ) -> cst.FunctionDef:
        self.functions.pop()
        return updated_node

    def leave_SimpleStatementLine(  # noqa: N802
        self, original_node: cst.SimpleStatementLine, updated_node: cst.SimpleStatementLine
    ) -> cst.BaseStatement | cst.FlattenSentinel[cst.BaseStatement]:
        if self.functions != ["f"]:
            return updated_node
        text = cst.Module([updated_node]).code
        hits = {
            n for n in self.after | self.guarded if f"{n} =" in text or f"{n}," in text or f"{n}:" in text
        }
        result: list[cst.BaseStatement] = [updated_node]
        if hits & self.guarded:
            guard = cst.parse_statement(GUARD[0] + "\n    pass\n")
            assert isinstance(guard, cst.If)
            result = [guard.with_changes(body=cst.IndentedBlock([updated_node]))]
        if hits & self.after:
            result.append(cst.parse_statement("\n".join(INSERTED) + "\n"))
        return cst.FlattenSentinel(result)


def mutate(data: bytes, after: Sequence[str], guarded: Sequence[str]) -> tuple[splicing.PatchPiece, ...]:
    file = parse_file("m.py", data, Path("root"))
    edits = [splicing.probe_import_edit(file, "pack")]
    for name in after:
        edits.append(
            splicing.insertion_edit(
                file, file.resolve_statement(site(name, AnchorKind.AFTER_ASSIGN)), INSERTED, "ab12"
            )
        )
    for name in guarded:
        edits.append(
            splicing.guard_edit(
                file, file.resolve_statement(site(name, AnchorKind.BEFORE_ASSIGN)), GUARD, "cd34"
            )
        )
    return splicing.apply_edits(file, edits)


def can_guard(data: bytes, name: str) -> bool:
    return f"; {name} = ".encode() not in data


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_unsplicing_restores_every_byte(data: st.DataObject) -> None:
    source, names = data.draw(sources())
    chosen = data.draw(st.lists(st.sampled_from(names), unique=True)) if names else []
    guarded = [n for n in data.draw(st.permutations(names))[: len(names) // 2] if can_guard(source, n)]
    pieces = mutate(source, chosen, guarded)
    result = splicing.mutated_bytes(pieces)
    compile(result, "m.py", "exec")
    assert splicing.unsplice(result) == source
    assert b"".join(x for p in pieces if p.sign != "+" for x in p.lines) == source
    untagged = [x for x in result.splitlines() if b"# fi:" not in x]
    assert [x.strip() for x in untagged] == [x.strip() for x in source.splitlines()]
    assert result.count(b"# fi:ab12") == len(INSERTED) * len(chosen)
    assert result.count(b"fi:cd34 guard:") == len(guarded)


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_splicing_equals_inserting_into_the_tree(data: st.DataObject) -> None:
    source, names = data.draw(sources())
    chosen = data.draw(st.lists(st.sampled_from(names), unique=True)) if names else []
    guarded = [n for n in names if n not in chosen and can_guard(source, n)][:2]
    result = splicing.mutated_bytes(mutate(source, chosen, guarded))
    without_import = b"".join(
        line for line in result.splitlines(keepends=True) if not line.rstrip().endswith(b"fi:probe")
    )
    direct = cst.parse_module(source).visit(Direct(set(chosen), set(guarded)))
    assert ast.dump(ast.parse(without_import)) == ast.dump(ast.parse(direct.bytes))
