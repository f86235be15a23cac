"""Values changed in place, in modules of Python's standard library."""

import ast
import importlib.util
import random
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import pytest

from mutator._common.extension_doors import OPERATOR_DOOR
from mutator.errors import MutatorError
from mutator.faults.fault_model_files import load_fault_models
from mutator.faults.fault_models import FaultModels
from mutator.model import Anchor, AnchorKind, FaultLocation, Injection
from mutator.mutants.changeable_expressions import Expression
from mutator.mutants.injection_edits import injection_edit
from mutator.mutants.parsed_files_and_anchors import ParsedFile, parse_file
from mutator.mutants.splicing import (
    ExpressionEdit,
    LineEdit,
    apply_edits,
    as_line_edits,
    mutated_bytes,
    unsplice,
)
from mutator.operators.mutation_listing import mutations_of
from mutator.operators.mutations import Mutation
from mutator.operators.statement_facts import statement_facts_of
from mutator.targets.source_tree import SourceTree

TEMPLATES = Path(__file__).parents[2] / "templates"
FEW = ("colorsys", "bisect", "shlex")
TOGETHER = 40  # values that one mutant changes
MANY = (
    *FEW,
    *("argparse", "ast", "calendar", "cmd", "configparser", "csv", "datetime", "decimal", "difflib", "dis"),
    *("doctest", "email.message", "fractions", "ftplib", "gettext", "heapq", "html.parser", "http.client"),
    *("inspect", "ipaddress", "json.decoder", "json.encoder", "locale", "mailbox", "nntplib", "optparse"),
    *(
        "pdb",
        "pickle",
        "pickletools",
        "plistlib",
        "pprint",
        "random",
        "sched",
        "smtplib",
        "string",
        "tarfile",
    ),
    *("textwrap", "tokenize", "traceback", "turtle", "typing", "unittest.mock", "urllib.parse", "uuid"),
    *("xml.dom.minidom", "zipfile"),
)
MODELS = (("stuck", (("value", 3.0),)), ("offset", (("by", -2.5),)), ("delay", (("delay", 0.5),)))


@cache
def models() -> FaultModels:
    return load_fault_models(TEMPLATES)


@cache
def module(name: str) -> ParsedFile | None:
    try:
        found = importlib.util.find_spec(name)
    except ModuleNotFoundError:
        return None
    if found is None or found.origin is None or not found.origin.endswith(".py"):
        return None
    return parse_file(f"{name}.py", Path(found.origin).read_bytes(), Path())


def anchors(file: ParsedFile) -> Iterator[tuple[Expression, FaultLocation]]:
    for function, known in file.expressions_by_function.items():
        seen = Counter[tuple[AnchorKind, str, str | None]]()
        for expression in known:
            for role in dict.fromkeys(expression.roles):
                seen[role] += 1
                kind, name, which = role
                anchor = Anchor(kind=kind, name=name, which=which, nth=seen[role])
                yield expression, FaultLocation(path=file.path, function=function, anchor=anchor)


def active(node: ast.expr) -> bool:
    return isinstance(node, ast.Call) and ast.unparse(node.func) == "_fi.active"


class Inactive(ast.NodeTransformer):
    """Removes the injected conditions, as if no fault were active. `kept` has the expressions with changed
    values."""

    def __init__(self) -> None:
        self.kept: list[str] = []

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        self.generic_visit(node)
        if not active(node.test):
            return node
        self.kept.append(ast.dump(node.orelse))
        return node.orelse

    def visit_If(self, node: ast.If) -> ast.AST | list[ast.stmt]:
        self.generic_visit(node)
        left_out = isinstance(node.test, ast.UnaryOp) and active(node.test.operand)
        return node.body if left_out else node


Case = tuple[Expression, FaultLocation]


def edit_of(file: ParsedFile, case: Case, number: int) -> ExpressionEdit:
    expression, location = case
    assert file.resolve_expression(location) is expression, location
    name, params = MODELS[number % len(MODELS)]
    injection = Injection(location=location, model=name, params=params)
    edit = injection_edit(file, models(), injection, f"{number:08x}")
    assert isinstance(edit, ExpressionEdit)
    return edit


def apart(cases: Sequence[Case]) -> Iterator[list[Case]]:
    left = list(cases)
    while left:
        group: list[Case] = []
        rest: list[Case] = []
        for case in left:
            one = case[0]
            beside = all(one.end <= other.start or other.end <= one.start for other, _ in group)
            (group if beside and len(group) < TOGETHER else rest).append(case)
        yield group
        left = rest


def check(file: ParsedFile, cases: Sequence[Case]) -> None:
    """Check that a mutant compiles, calls the probe once for each value, changes exactly these expressions,
    and equals the module while no fault is active."""
    edits = [edit_of(file, case, number) for number, case in enumerate(cases)]
    kept = check_edits(file, edits, cases)
    assert sorted(kept) == sorted(ast.dump(expression.node) for expression, _ in cases), cases


def check_edits(file: ParsedFile, edits: Sequence[LineEdit | ExpressionEdit], cases: object) -> list[str]:
    data = mutated_bytes(apply_edits(file, as_line_edits(file, edits)))
    assert unsplice(data) == file.data, cases
    tree = ast.parse(data)
    compile(tree, "<mutant>", "exec", dont_inherit=True)
    asked = [node for node in ast.walk(tree) if isinstance(node, ast.expr) and active(node)]
    assert len(asked) == len(edits), cases
    inactive = Inactive()
    assert ast.dump(inactive.visit(tree)) == ast.dump(ast.parse(file.data)), cases
    return inactive.kept


def checked(names: Sequence[str], count: int) -> int:
    files = [file for name in names if (file := module(name))]
    cases = [(file, pair) for file in files for pair in anchors(file)]
    chosen = random.Random(1).sample(cases, min(count, len(cases)))
    for file in files:
        for group in apart([pair for one, pair in chosen if one is file]):
            check(file, group)
    return len(chosen)


def test_a_mutant_differs_only_in_its_changed_values() -> None:
    assert checked(FEW, 300) == 300


@pytest.mark.slow
def test_20000_mutants_differ_only_in_their_changed_values() -> None:
    assert checked(MANY, 20_000) == 20_000


def mutations(file: ParsedFile) -> Iterator[Mutation]:
    tree = SourceTree(root=Path(), files={file.path: file.data}, digest="", _digest_inputs={})
    facts = statement_facts_of(tree, file.path)
    for function in file.functions_by_name:
        yield from mutations_of(file, facts, function, models(), OPERATOR_DOOR.shipped_names())


def checked_mutations(names: Sequence[str], count: int) -> int:
    files = [file for name in names if (file := module(name))]
    drawn = [(file, mutation) for file in files for mutation in mutations(file)]
    chosen = random.Random(2).sample(drawn, min(count, len(drawn)))
    for file in files:
        own = [mutation for one, mutation in chosen if one is file]
        for first in range(0, len(own), TOGETHER):
            edits: list[LineEdit | ExpressionEdit] = []
            for number, mutation in enumerate(own[first : first + TOGETHER]):
                injection = mutation.to_fault("as_is").injections[0]
                edit = injection_edit(file, models(), injection, f"{number:08x}")
                try:
                    apply_edits(file, as_line_edits(file, [*edits, edit]))
                except MutatorError:  # one contains the other
                    check_edits(file, [edit], mutation)
                else:
                    edits.append(edit)
            check_edits(file, edits, own)
    return len(chosen)


def test_a_mutation_changes_nothing_else() -> None:
    assert checked_mutations(FEW, 150) == 150


@pytest.mark.slow
def test_20000_mutations_change_nothing_else() -> None:
    assert checked_mutations(MANY, 20_000) == 20_000
