"""Injections into one instance or some executions, in modules of Python's standard library."""

import ast
import random
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

import pytest

from mutator.config.instance_conditions import canonical_instance_condition
from mutator.errors import MutatorError
from mutator.model import Anchor, AnchorKind, FaultLocation, Injection
from mutator.mutants.injected_line_syntax import tag_of
from mutator.mutants.injection_edits import injection_edit
from mutator.mutants.parsed_files_and_anchors import ParsedFile
from mutator.mutants.splicing import apply_edits, as_line_edits, mutated_bytes, unsplice

from .test_value_anchors import FEW, MANY, anchors, models, module

ASKING = ("_fi.on", "_fi.call", "_fi.every", "_fi.active")
SHAPES = (
    "{0} == 2",
    "{0} is {1}",
    "not {0}.left and {1}[0] != 'x'",
    "{0} in (1, -2.5, None) or {1}['a'].b",
    "{0} < {1} <= 3",
)


def statements(file: ParsedFile) -> Iterator[FaultLocation]:
    for function, known in file.functions_by_name.items():
        seen = Counter(
            name
            for one in known
            for s in one.statements
            if not s.unanchorable_reason
            for name in s.assigned_names
        )
        for name, count in seen.items():
            for nth in range(1, count + 1):
                anchor = Anchor(kind=AnchorKind.BEFORE_ASSIGN, name=name, nth=nth)
                location = FaultLocation(path=file.path, function=function, anchor=anchor)
                try:
                    site = file.resolve_statement(location)
                except MutatorError:
                    continue
                if site.is_alone_on_line and site.first_line != site.end_line:
                    yield location


class Inactive(ast.NodeTransformer):
    def __init__(self) -> None:
        self.asked = 0

    def asks(self, test: ast.expr) -> bool:
        asked = [test.values[0], test.values[-1]] if isinstance(test, ast.BoolOp) else [test]
        found = all(isinstance(one, ast.Call) and ast.unparse(one.func) in ASKING for one in asked)
        self.asked += found
        return found

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        self.generic_visit(node)
        return node.orelse if self.asks(node.test) else node

    def visit_If(self, node: ast.If) -> ast.AST | list[ast.stmt]:
        self.generic_visit(node)
        guards = isinstance(node.test, ast.UnaryOp) and self.asks(node.test.operand)
        return node.body if guards else node


def limited(random_: random.Random, file: ParsedFile, location: FaultLocation) -> Injection:
    value = location.anchor.kind is not AnchorKind.BEFORE_ASSIGN
    made = Injection(
        location=location,
        model="stuck" if value else "omission",
        params=(("value", 3.0),) if value else (),
    )
    names = sorted(file.names_used_in_function_at(location))
    if names and random_.random() < 0.8:
        text = random_.choice(SHAPES).format(random_.choice(names), random_.choice(names))
        made = replace(made, where=canonical_instance_condition(text))
    number = random_.randrange(1, 100)
    return replace(made, **random_.choice(({"call": number}, {"every": number}, {})))


def check(file: ParsedFile, injection: Injection) -> None:
    """Check that a mutant compiles, equals the module while its fault is inactive, and has a tag for its
    probe call."""
    edit = injection_edit(file, models(), injection, "0a1b2c3d")
    data = mutated_bytes(apply_edits(file, as_line_edits(file, [edit])))
    assert unsplice(data) == file.data, injection
    tree, inactive = ast.parse(data), Inactive()
    compile(tree, "<mutant>", "exec", dont_inherit=True)
    assert ast.dump(inactive.visit(tree)) == ast.dump(ast.parse(file.data)), injection
    assert inactive.asked == 1
    (tag, *_) = [tag for line in data.splitlines() if (tag := tag_of(line))]
    assert tag.is_guard if tag.replaced_line is None else "_fi.active" in data.decode(file.encoding)


def checked(names: Sequence[str], count: int) -> int:
    files = [file for name in names if (file := module(name))]
    cases = [(file, location) for file in files for _, location in anchors(file)]
    guarded = [(file, location) for file in files for location in statements(file)]
    random_ = random.Random(1)
    chosen = random_.sample(cases, min(count // 2, len(cases)))
    chosen += random_.sample(guarded, min(count - len(chosen), len(guarded)))
    for file, location in chosen:
        check(file, limited(random_, file, location))
    return len(chosen)


def test_a_limited_mutant_differs_only_in_its_injection() -> None:
    assert checked(FEW[:2], 130) == 130


@pytest.mark.slow
def test_thousands_of_limited_mutants_differ_only_in_their_injection() -> None:
    assert checked((*FEW, *MANY[:20]), 4000) == 4000
