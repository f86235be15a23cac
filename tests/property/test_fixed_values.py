"""Constants and defaults that the probe sets, in modules of Python's standard library."""

import ast
import inspect
import random
import sys
import types
from collections.abc import Iterator, Sequence
from typing import Any

import pytest

from mutator.model import Anchor, AnchorKind, FaultLocation, Hold, Injection, Trigger
from mutator.mutants.constants_and_defaults import ConstantOrDefault
from mutator.mutants.injection_edits import injection_edit
from mutator.mutants.parsed_files_and_anchors import ParsedFile
from mutator.mutants.probe_contract import build_probe_settings, render_probe
from mutator.mutants.splicing import apply_edits, as_line_edits, mutated_bytes, probe_import_edit, unsplice
from mutator.targets.observed_values import Observation

from .test_value_anchors import MANY, models, module

FEW = ("colorsys", "shlex", "textwrap", "calendar", "fractions", "string", "csv", "gettext", "argparse")
TOGETHER = 40  # values that one mutant sets
MORE = ("imaplib", "logging", "logging.handlers", "pydoc", "shutil", "ssl", "subprocess", "tempfile")
MORE += ("tkinter.constants", "token", "xmlrpc.client")


def locations(file: ParsedFile) -> list[tuple[ConstantOrDefault, FaultLocation]]:
    found = []
    for one in file.constants_and_defaults:
        if one.unsettable_reason is None:
            anchor = Anchor(kind=one.kind, name=one.name)
            found.append((one, FaultLocation(path=file.path, function=one.function, anchor=anchor)))
    return found


def mutant(file: ParsedFile, cases: Sequence[tuple[ConstantOrDefault, FaultLocation]]) -> bytes:
    edits = [probe_import_edit(file, None)]
    for number, (one, location) in enumerate(cases):
        assert file.resolve_constant_or_default(location) is one
        injection = Injection(location=location, model="stuck", params=(("value", "another"),))
        edits.append(injection_edit(file, models(), injection, f"{number:08x}"))  # type: ignore[arg-type]
    data = mutated_bytes(apply_edits(file, as_line_edits(file, edits)))
    assert unsplice(data) == file.data, cases
    return data


class WithoutProbe(ast.NodeTransformer):
    def visit_Import(self, node: ast.Import) -> ast.AST | None:
        return None if node.names[0].name == "_fi" else node

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        return None if ast.unparse(node).startswith(("_fi.constant(", "_fi.default(")) else node


def probe(ids: Sequence[str]) -> Any:
    nowhere = FaultLocation(path="", function="f", anchor=Anchor(kind=AnchorKind.ENTRY))
    observation = Observation(location=nowhere, time="t", values=(), derived=())
    trigger = Trigger(name="test", condition="t >= 1 and t < 2")
    settings = build_probe_settings("m", trigger, Hold.WHILE, ids, observation, 1.0, sets=True)
    made = types.ModuleType("_fi")
    exec(render_probe(models().probe_templates, settings).text, vars(made))
    return made


def read(names: types.ModuleType, one: ConstantOrDefault) -> Any:
    """Return a constant's value, or a default from the signature that Python reports."""
    *path, last = one.dotted_path.split(".")
    found: Any = names
    for name in path:
        found = vars(found)[name]
    if one.kind is AnchorKind.CONSTANT:
        return vars(found)[last]
    found = found.fget if isinstance(found, property) else getattr(found, "__func__", found)
    return inspect.signature(inspect.unwrap(found)).parameters[last].default


def readable(
    names: types.ModuleType, cases: Sequence[tuple[ConstantOrDefault, FaultLocation]]
) -> Iterator[ConstantOrDefault]:
    """Yield the values that exist on this system. The library defines some only on other systems."""
    for one, _ in cases:
        try:
            read(names, one)
        except (KeyError, AttributeError, TypeError, ValueError):
            continue
        yield one


def check(file: ParsedFile, cases: Sequence[tuple[ConstantOrDefault, FaultLocation]], *, run: bool) -> None:
    """Check that a mutant compiles and equals the module except for the lines that set values. With `run`,
    each value must differ only in an active step and be restored afterwards."""
    data = mutant(file, cases)
    tree = ast.parse(data)
    compile(tree, "<mutant>", "exec", dont_inherit=True)
    assert ast.dump(WithoutProbe().visit(tree)) == ast.dump(ast.parse(file.data)), cases
    if not run:
        return
    names, fi = types.ModuleType(f"set_{file.path[:-3]}"), probe([f"{i:08x}" for i in range(len(cases))])
    sys.modules |= {"_fi": fi, names.__name__: names}
    try:
        exec(compile(data, file.path, "exec", dont_inherit=True), vars(names))
        known = list(readable(names, cases))
        before = [read(names, one) for one in known]
        seen = []
        for t in (0.0, 1.0, 2.0):
            fi.observe(t=t)
            seen.append([read(names, one) for one in known])
    finally:
        del sys.modules["_fi"], sys.modules[names.__name__]
    assert all(one is other for at in (0, 2) for one, other in zip(before, seen[at], strict=True)), cases
    assert seen[1] == ["another"] * len(known), [
        c for c, v in zip(known, seen[1], strict=True) if v != "another"
    ]
    counts = [told["count"] for told in fi.report()["injections"].values()]
    assert sum(counts) >= len(known)
    assert set(counts) <= {0, 1}


def checked(names: Sequence[str], count: int, *, run: bool) -> int:
    files = [file for name in names if (file := module(name))]
    cases = [(file, pair) for file in files for pair in locations(file)]
    chosen = random.Random(1).sample(cases, min(count, len(cases)))
    for file in files:
        own = [pair for one, pair in chosen if one is file]
        for at in range(0, len(own), TOGETHER):
            check(file, own[at : at + TOGETHER], run=run)
    return len(chosen)


def test_values_that_the_probe_sets_are_restored() -> None:
    assert checked(FEW, 200, run=True) == 200


@pytest.mark.slow
def test_thousands_of_values_that_the_probe_sets_are_restored() -> None:
    """Modules with side effects at import are not run."""
    assert checked(FEW, 2000, run=True) > 250
    assert checked((*MANY, *MORE), 3000, run=False) == 3000
