"""Fault models that repeat or exchange statements, tried throughout the shipped controller."""

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.model import Anchor, AnchorKind, FaultLocation, Injection
from mutator.mutants.injection_edits import injection_edit
from mutator.mutants.parsed_files_and_anchors import ParsedFile, parse_file
from mutator.mutants.splicing import apply_edits, mutated_bytes, unsplice
from mutator.workspace import Workspace

CLONE = Path(__file__).parents[2]
TARGET = CLONE / "target"
FEW = [TARGET / "selfdrive/controls/lib/longcontrol.py"]
ALL = sorted(p for part in ("car", "controls") for p in (TARGET / "selfdrive" / part).rglob("*.py"))
EXCUSES = (
    "the next statement is missing",
    "the anchor is not at a statement that is alone",
    "the anchored statement",
    "the template contains `yield`",
    "ends its block",
)


class _Inactive(ast.NodeTransformer):
    """Removes the probe's conditions. The body of `else:` stays."""

    def visit_If(self, node: ast.If) -> ast.stmt | list[ast.stmt] | None:
        self.generic_visit(node)
        return node.orelse if ast.unparse(node.test).startswith("_fi.active(") else node


def locations(file: ParsedFile) -> Iterator[FaultLocation]:
    for function, found in file.functions_by_name.items():
        seen: Counter[tuple[str, str]] = Counter()
        for statement in (
            s
            for one in found
            for s in one.statements
            if s.unanchorable_reason is None and s.block_start_of_head_binding is None
        ):
            for verb in ("assign", "call", "return"):
                for name in dict.fromkeys(statement.names_for(verb)):
                    seen[verb, name] += 1
                    kind = AnchorKind(f"before_{verb}")
                    anchor = Anchor(kind=kind, name=name, nth=seen[verb, name])
                    yield FaultLocation(path=file.path, function=function, anchor=anchor)


@pytest.mark.parametrize(
    ("files", "least"), [(FEW, 20), pytest.param(ALL, 400, marks=pytest.mark.slow)], ids=["few", "all"]
)
@pytest.mark.parametrize("model", ["reordering", "repetition"])
def test_statements_of_the_controller_are_repeated_and_exchanged(
    model: str, files: list[Path], least: int
) -> None:
    models, made = Workspace.find(root=CLONE).fault_models(), 0
    for path in files:
        file = parse_file(path.name, path.read_bytes(), TARGET)
        whole = ast.dump(ast.parse(file.data))
        for location in locations(file):
            injection = Injection(location=location, model=model)
            try:
                edit = injection_edit(file, models, injection, "ab12")
            except MutatorError as error:
                assert any(excuse in error.got for excuse in EXCUSES), error
                continue
            data = mutated_bytes(apply_edits(file, [edit]))  # type: ignore[list-item]
            compile(data, "m.py", "exec")
            assert unsplice(data) == file.data
            assert ast.dump(_Inactive().visit(ast.parse(data))) == whole
            made += 1
    assert made > least
