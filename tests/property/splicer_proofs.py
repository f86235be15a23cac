"""What must hold for mutants of any source, proved by `ast`, bytecode and execution, without LibCST."""

import ast
import contextlib
import random
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mutator.errors import MutatorError
from mutator.faults.fault_models import SnippetKind
from mutator.model import AnchorKind, Injection
from mutator.mutants import splicing
from mutator.mutants.injection_edits import injection_edit
from mutator.mutants.parsed_files_and_anchors import ParsedFile, ResolvedAnchor, parse_file
from mutator.mutants.template_rendering import render_snippet
from mutator.workspace import Workspace

from .anchors_by_ast import AFTER, BEFORE, Spot, spots
from .injected_statements import Beside, Lines, take_out
from .names_in_bytecode import is_carried_out, keeps_names

Run = Callable[[bytes], object]  # executes a source and returns what it did
_MODELS = Workspace.find(root=Path(__file__).parents[2]).fault_models()
_VARIABLE = "?"
_INJECTIONS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("stuck", {"target": _VARIABLE, "value": 1.0}),
    ("offset", {"target": _VARIABLE, "by": 1.0, "low": 0.0, "high": 5.0}),
    ("delay", {"target": _VARIABLE, "delay": 0.5}),
    ("ghost_object", {"distance_name": _VARIABLE, "distance": 5.0, "speed_name": _VARIABLE, "speed": 2.0}),
    ("omission", {}),
    (
        "image_effect",
        {"target": _VARIABLE, "effect": "pack.G0", "amount": 1.0, "camera": "x", "scene": "x", "seed": 1},
    ),
)


class Wrong(AssertionError):
    pass


@dataclass(slots=True)
class Figures:
    modules: Counter[str] = field(default_factory=Counter)
    anchors: Counter[str] = field(default_factory=Counter)
    variables: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        lines = []
        for title in ("modules", "anchors", "variables"):
            counter: Counter[str] = getattr(self, title)
            lines.append(f"{title}: {sum(counter.values())}")
            lines += [f"  {count:9}  {what}" for what, count in counter.most_common()]
        return "\n".join([*lines, f"wrong: {len(self.wrong)}", *self.wrong[:10]])


@dataclass(frozen=True, slots=True)
class _Placed:
    spot: Spot
    edit: splicing.LineEdit
    guard: bool = False

    @property
    def name(self) -> str:
        return self.edit.lines[0].decode("latin-1").split('"')[1]


def prove(data: bytes, figures: Figures, run: Run | None = None, variables: int = 3) -> None:
    """Splice at every anchor of a source, set variables at `variables` random ones, and count the outcomes.
    Raise Wrong if a mutant violates a property or a refusal is unnecessary."""
    tree = _tree(data)
    try:
        file = parse_file("m.py", data, Path("root"))
    except MutatorError as error:
        _expect("not valid Python" not in error.got or tree is None, f"refused: {error}")
        figures.modules[_reason(error)] += 1
        return
    if tree is None:
        raise Wrong("an invalid source was accepted")
    figures.modules["spliced"] += 1
    before = run(data) if run else None
    groups, whole = _groups(file, tree, figures), ast.dump(tree)
    for group in groups.values():
        mutant = _spliced(file, group)
        _check_tree(whole, mutant, group)
        _expect(run is None or run(mutant) == before, "it behaves differently", mutant)
    everywhere = [placed.spot for group in groups.values() for placed in group]
    for spot in random.Random(len(data)).choices(everywhere, k=variables) if everywhere else ():
        mutant = _with_variable_set(file, spot, figures)
        _expect(run is None or not mutant or run(mutant) == before, f"{spot}: other behaviour", mutant)


def _tree(data: bytes) -> ast.Module | None:
    try:
        compile(data, "m.py", "exec", dont_inherit=True)
        return ast.parse(data)
    except (SyntaxError, ValueError):
        return None


def _expect(holds: bool, what: str, mutant: bytes = b"") -> None:
    if not holds:
        raise Wrong(f"{what}\n{mutant.decode(errors='replace')}")


def _reason(error: MutatorError) -> str:
    """Return the reason of a refusal without file names and numbers. The error must name the file."""
    _expect(error.where is not None, f"no file: {error}")
    text = re.sub(
        r"'[^']*'|`[^`]*`|\d+", "_", re.sub(r"(error: [a-z ]+).*", r"\1", error.got, flags=re.DOTALL)
    )
    return "refused: " + re.sub(r" in [\w.]+(?=,|$)", "", text.partition(", where")[0])


# At every anchor


def _groups(file: ParsedFile, tree: ast.Module, figures: Figures) -> dict[str, list[_Placed]]:
    groups: dict[str, list[_Placed]] = {}
    for i, spot in enumerate(spots(tree)):
        name = f"{i:08x}"
        try:
            site = file.resolve_statement(spot.location)
        except MutatorError as error:
            _expect(error.line is not None and _crowded(file, spot), f"{spot}: {error}")
            figures.anchors[_reason(error)] += 1
            continue
        _check_site(file, site, spot)
        figures.anchors[spot.kind.value] += 1
        code = (f'if _fi.active("{name}"):', f'    _fi.report("{name}")')
        edit = splicing.insertion_edit(file, site, code, name)
        groups.setdefault(spot.kind.value, []).append(_Placed(spot, edit))
        if spot.kind in BEFORE:
            _add_guard(file, site, _Placed(spot, edit), groups, figures)
    return groups


def _add_guard(
    file: ParsedFile,
    site: ResolvedAnchor,
    placed: _Placed,
    groups: dict[str, list[_Placed]],
    figures: Figures,
) -> None:
    try:
        edit = splicing.guard_edit(file, site, (f'if not _fi.active("{placed.name}"):',), placed.name)
    except MutatorError as error:
        _expect(error.line is not None and _crowded(file, placed.spot), f"{placed.spot}: {error}")
        figures.anchors[_reason(error)] += 1
        return
    figures.anchors["guard"] += 1
    guards = groups.setdefault("guard", [])
    if all(
        other.edit.line_index != edit.line_index for other in guards
    ):  # several anchors name one statement
        guards.append(_Placed(placed.spot, edit, guard=True))


def _crowded(file: ParsedFile, spot: Spot) -> bool:
    """Whether an anchor must be refused, because its statement returns or shares its lines."""
    node, kind = spot.node, spot.kind
    if kind is AnchorKind.ENTRY:
        node = spot.within.body[0]
    start, end = (_line(file, n) for n in (node.lineno, node.end_lineno or 0))
    continued = node.lineno > 1 and _line(file, node.lineno - 1).rstrip(b"\r\n").endswith(b"\\")
    after = end[node.end_col_offset :].strip(b" \t\f\r\n;")
    shared = (
        bool(start[: node.col_offset].strip()) or continued or (bool(after) and not after.startswith(b"#"))
    )
    return shared or (kind in AFTER and isinstance(node, ast.Return))


def _line(file: ParsedFile, number: int) -> bytes:
    """Return a line in UTF-8, because `ast` counts columns in UTF-8 bytes, and without the byte order
    mark."""
    return file.lines[number - 1].decode(file.encoding).removeprefix("\ufeff").encode()


def _check_site(file: ParsedFile, site: ResolvedAnchor, spot: Spot) -> None:
    end = spot.node.end_lineno or 0
    if spot.kind in AFTER:
        between = b"".join(file.lines[end : site.end_line]).strip(b" \t\f\r\n\\;")
        _expect(site.end_line >= end and not between, f"{spot} ends before line {site.end_line}")
    elif spot.kind in BEFORE:
        _expect(site.first_line == spot.node.lineno - 1, f"{spot} begins at line {site.first_line + 1}")


def _spliced(file: ParsedFile, group: Sequence[_Placed]) -> bytes:
    edits = [placed.edit for placed in group]
    with contextlib.suppress(MutatorError):  # a byte order mark right before the first statement
        edits.append(splicing.probe_import_edit(file, "pack"))
    mutant = splicing.mutated_bytes(splicing.apply_edits(file, edits))
    try:
        compile(mutant, "m.py", "exec", dont_inherit=True)
    except SyntaxError as error:
        raise Wrong(f"it does not compile: {error}\n{mutant.decode(errors='replace')}") from None
    _expect(splicing.unsplice(mutant) == file.data, "it does not un-splice", mutant)
    return mutant


def _check_tree(original: str, mutant: bytes, group: Sequence[_Placed]) -> None:
    """Check that each injected statement is next to its anchored one and that nothing else has changed."""
    lines, changed = Lines.of(mutant), ast.parse(mutant)
    found: dict[str, Beside] = {}
    take_out(changed, lines.injected, found)
    _expect(ast.dump(changed) == original, "more than the injected statements differs", mutant)
    for placed in group:
        spot = placed.spot
        _expect(placed.name in found, f"{spot} has no statement", mutant)
        beside = found[placed.name]
        if spot.kind is AnchorKind.ENTRY:
            node, first = beside.around, spot.within.body
            text = ast.get_docstring(spot.within, clean=False)
            _expect(beside.place == (text is not None) and bool(first), f"{spot} is not at the entry", mutant)
        else:
            node = beside.above if spot.kind in AFTER else beside.below
        here = node and (type(node), lines.original[node.lineno], lines.original[node.end_lineno])
        _expect(
            here == (type(spot.node), spot.node.lineno, spot.node.end_lineno), f"{spot} is at {here}", mutant
        )
        if not placed.guard:
            _expect(node.col_offset == spot.node.col_offset, f"{spot} is in another column", mutant)


# Setting variables


def _with_variable_set(file: ParsedFile, spot: Spot, figures: Figures) -> bytes:
    """Return a mutant that sets a variable at an anchor, or empty bytes if the splicer refuses. Each name
    must keep its scope."""
    chosen = random.Random(f"{spot.location}")
    known = sorted(
        {n.id for n in ast.walk(spot.within) if isinstance(n, ast.Name)} - {"int"} | {"max", "new"}
    )
    model, params = chosen.choice(_INJECTIONS)
    params = {name: chosen.choice(known) if value == _VARIABLE else value for name, value in params.items()}
    injection = Injection(location=spot.location, model=model, params=tuple(sorted(params.items())))
    try:
        edit = injection_edit(file, _MODELS, injection, "abcd0123")
    except MutatorError as error:
        _expect(error.line is not None, f"no line: {error}")
        if moved := re.match(r"the lines would make '(.+)' .* in (.+), where", error.got):
            kept = keeps_names(file.data, _forced(file, spot, model, params))
            _expect(not kept or not is_carried_out(file.data, moved[2], moved[1]), f"refused: {error}")
        figures.variables[_reason(error)] += 1
        return b""
    try:
        mutant = _spliced(file, [_Placed(spot, edit)])
    except Wrong as error:
        late = re.search(r"(before|prior to) (global|nonlocal) declaration", str(error))
        _expect(late is not None, str(error))
        figures.variables["refused: the mutant does not compile"] += 1
        return b""
    figures.variables[model] += 1
    _expect(keeps_names(file.data, mutant), f"{injection} changes what names mean", mutant)
    return mutant


def _forced(file: ParsedFile, spot: Spot, model: str, params: dict[str, Any]) -> bytes:
    site, code = file.resolve_statement(spot.location), render_snippet(_MODELS.get(model), params, "abcd0123")
    make = splicing.guard_edit if _MODELS.get(model).kind is SnippetKind.GUARD else splicing.insertion_edit
    return splicing.mutated_bytes(splicing.apply_edits(file, [make(file, site, code, "abcd0123")]))
