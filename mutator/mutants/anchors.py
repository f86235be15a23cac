"""Resolves anchors, such as an assignment in a function, to lines of a source file."""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from mutator._common.interrupts import held
from mutator._common.message_text import counted, suggestion
from mutator.errors import MutatorError
from mutator.model import FIXED_ANCHORS, VALUE_ANCHORS, Anchor, AnchorKind, FaultLocation
from mutator.mutants.constants_and_defaults import FixedValue, choose_fixed, find_fixed
from mutator.mutants.expression_anchors import as_written, choose_expression, valid_nth
from mutator.mutants.expressions import Expression, expressions_of
from mutator.mutants.name_scopes import as_compiled, function_names
from mutator.mutants.node_positions import Place, places_by_ast
from mutator.mutants.source_parsing import import_line, libcst_module, python_tree, reading, refuse_unfit
from mutator.mutants.standalone_functions import outer_functions
from mutator.mutants.statements import Function, Statement, collect
from mutator.targets.source_tree import SourceTree


@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """A resolved anchor. The statement is on lines `first` to `last` (from 0, `last` exclusive).

    An `entry` has no statement: `first` equals `last`.
    """

    first: int
    last: int
    after: bool
    alone: bool
    reindent: int  # lines that a guard can indent: all, or only the first if a string spans lines
    indent: bytes
    names: frozenset[str]  # used in the function


@dataclass(frozen=True)
class ParsedFile:
    path: str
    data: bytes
    lines: tuple[bytes, ...]
    encoding: str
    newline: bytes
    indent_unit: bytes
    import_line: int  # the import of the probe is inserted before this line
    functions: Mapping[str, tuple[Function, ...]]
    places: frozenset[Place]  # according to `ast`
    expressions: Mapping[str, tuple[Expression, ...]]  # by function
    fixed: tuple[FixedValue, ...]
    outer: tuple[range, ...]  # the lines of each outermost function
    where: Path
    sound: set[Hashable] = field(default_factory=set, repr=False, compare=False)  # edits that passed checks
    _sites: dict[tuple[str, Anchor], Site] = field(default_factory=dict, repr=False, compare=False)

    def resolve_value(self, location: FaultLocation) -> Expression:
        """Return the expression at the location; MutatorError with candidates unless exactly one matches."""
        functions = functions_named(self, location.function)
        expressions = self.expressions.get(plain_name(location.function), ())
        return choose_expression(expressions, location, self.where, functions[0].line)

    def resolve_fixed(self, location: FaultLocation) -> FixedValue:
        """Return the constant or default at the location; MutatorError with candidates if there is none."""
        if location.function:
            functions_named(self, location.function)
        return choose_fixed(self.fixed, location, self.where)

    def span(self, location: FaultLocation) -> tuple[int, int]:
        """Return the lines of the statement or value at the location (from 0, the last exclusive)."""
        if location.anchor.kind in VALUE_ANCHORS:
            expression = self.resolve_value(location)
            return expression.start[0], expression.end[0] + 1
        if location.anchor.kind in FIXED_ANCHORS:
            fixed = self.resolve_fixed(location)
            return fixed.first, fixed.last
        site = self.resolve(location)
        return site.first, site.last

    def outer_function(self, line: int) -> range | None:
        """Return the lines of the outermost function that contains this line (from 0)."""
        return next((lines for lines in self.outer if line in lines), None)

    def names(self, location: FaultLocation) -> frozenset[str]:
        """Return the names used in the function that contains the location."""
        if location.anchor.kind not in VALUE_ANCHORS:
            return self.resolve(location).names
        line = self.resolve_value(location).start[0]
        above = [function for function in functions_named(self, location.function) if function.line <= line]
        return max(above, key=lambda one: one.line).names

    def resolve(self, location: FaultLocation) -> Site:
        """Return the statement at the location; MutatorError with candidates unless exactly one matches."""
        key = (location.function, location.anchor)
        if key not in self._sites:
            self._sites[key] = _resolve(self, location)
        return self._sites[key]


def parsed(tree: SourceTree, path: str) -> ParsedFile:
    """Parse the file only once; MutatorError if it is not a Python file of the target."""
    return tree.derived(path, parse_file)


@held()
def parse_file(path: str, data: bytes, root: Path) -> ParsedFile:
    """Parse a file of the target; MutatorError if it is not Python, or already has injected lines."""
    where = root / path
    refuse_unfit(data, where)
    tree = python_tree(data, where)
    with reading(where):
        module, positions = libcst_module(data, where)
        return ParsedFile(
            path=path,
            data=data,
            lines=tuple(data.splitlines(keepends=True)),
            encoding=module.encoding.removesuffix("-sig"),
            newline=module.default_newline.encode(),
            indent_unit=module.default_indent.encode(),
            import_line=import_line(module, positions),
            functions=collect(module, positions, function_names(data)),
            expressions=expressions_of(data, module, positions),
            fixed=find_fixed(data, tree),
            outer=tuple(outer_functions(tree)),
            places=places_by_ast(tree),
            where=where,
        )


def plain_name(function: str) -> str:
    """Return a function's qualified name without `<locals>`, normalized as the compiler does."""
    return as_compiled(function.replace(".<locals>", ""))


def functions_named(file: ParsedFile, function: str) -> tuple[Function, ...]:
    """Return the functions with that qualified name; MutatorError with candidates if there is none."""
    name = plain_name(function)
    functions = file.functions.get(name)
    if not functions:
        names = list(file.functions)
        raise MutatorError(
            f"no function '{function}'",
            where=file.where,
            expected=f"a function of the file: {', '.join(names) or 'it has none'}",
            remedy="correct the qualified name" + suggestion(name, names),
        )
    return functions


def _resolve(file: ParsedFile, location: FaultLocation) -> Site:
    functions = functions_named(file, location.function)
    if location.anchor.kind is AnchorKind.ENTRY:
        return _entry(file, location, functions)
    function, statement = _choose(file, location, functions)
    _refuse_awkward(file, location.anchor, statement)
    _check_place(file, statement.place)
    if statement.opens is not None:
        return _inside(file, statement.opens, function.names)
    first = statement.first
    return Site(
        first=first,
        last=statement.last,
        after=location.anchor.kind in (AnchorKind.AFTER_ASSIGN, AnchorKind.AFTER_CALL),
        alone=statement.alone,
        reindent=1 if statement.spanning_string else statement.last - first,
        indent=_indent(file.lines[first]),
        names=function.names,
    )


def _inside(file: ParsedFile, first: int, names: frozenset[str]) -> Site:
    indent = _indent(file.lines[first])
    return Site(first=first, last=first, after=True, alone=True, reindent=0, indent=indent, names=names)


def _check_place(file: ParsedFile, place: Place | None) -> None:
    if place is not None and place.in_bytes(file.lines, file.encoding) not in file.places:
        raise MutatorError(
            "LibCST and Python's own parser give different positions for this statement",
            where=file.where,
            line=place.start[0],
            expected="the same position from both",
            remedy="anchor at another statement, or reformat the target",
        )


def _indent(line: bytes) -> bytes:
    return line[: len(line) - len(line.lstrip(b" \t\f"))]


def _entry(file: ParsedFile, location: FaultLocation, functions: tuple[Function, ...]) -> Site:
    nth = location.anchor.nth
    if (len(functions) > 1) if nth is None else (nth > len(functions)):
        places = ", ".join(f"line {f.line + 1}" for f in functions)
        raise MutatorError(
            f"{counted(len(functions), 'function')} named '{location.function}'"
            + (f", but `nth` is {nth}" if nth else ""),
            where=file.where,
            line=functions[0].line + 1,
            expected=f"one of those at {places}" if len(functions) > 1 else f"the one at {places}",
            remedy=f"give `nth`, {valid_nth(len(functions))}",
        )
    function = functions[(nth or 1) - 1]
    if function.entry is None:
        raise MutatorError(
            f"nothing can be inserted at the entry of function '{location.function}'",
            where=file.where,
            line=function.line + 1,
            expected="a body below the `def` line, and nothing else on the docstring's lines",
            remedy="anchor somewhere else, or reformat the target",
        )
    _check_place(file, function.place)
    index, model_line = function.entry
    return Site(
        first=index,
        last=index,
        after=index != model_line,
        alone=True,
        reindent=0,
        indent=_indent(file.lines[model_line]),
        names=function.names,
    )


def _choose(
    file: ParsedFile, location: FaultLocation, functions: tuple[Function, ...]
) -> tuple[Function, Statement]:
    anchor = location.anchor
    verb = anchor.kind.partition("_")[2]
    name = as_written(anchor.name)
    pairs = [(f, s) for f in functions for s in f.statements if name in s.names(verb)]
    # heads of blocks are numbered last, so that `nth` in older specs selects the same statements
    hits = sorted(
        (pair for pair in pairs if pair[1].reason is None), key=lambda pair: pair[1].opens is not None
    )
    statements = sum(s.opens is None for _, s in hits)
    nth = anchor.nth
    if hits and (1 in (len(hits), statements) if nth is None else nth <= len(hits)):
        return hits[(nth or 1) - 1]
    raise _no_single_hit(file, location, functions, pairs, hits)


def _no_single_hit(
    file: ParsedFile,
    location: FaultLocation,
    functions: tuple[Function, ...],
    pairs: list[tuple[Function, Statement]],
    hits: list[tuple[Function, Statement]],
) -> MutatorError:
    """Return the error about an ambiguous or missing anchor.

    `pairs` are all matches of the name, `hits` those that are whole statements or heads of blocks.
    """
    anchor = location.anchor
    verb = anchor.kind.partition("_")[2]
    what, place = _what(verb, anchor.name), f"in {location.function}"
    if hits:
        lines = ", ".join(str(s.first + 1) for _, s in hits)
        nth_range = valid_nth(len(hits))
        statement_count = counted(len(hits), "statement")
        got = f"{what} matches {statement_count} {place}: {'lines' if len(hits) > 1 else 'line'} {lines}"
        remedy = (
            f"give `nth`, {nth_range}" if anchor.nth is None else f"`nth` is {anchor.nth}: give {nth_range}"
        )
        line, expected = hits[0][1].first, "exactly one"
    elif pairs:
        statement = pairs[0][1]
        got = f"{what} {place} is not a separate statement: {statement.reason}"
        line, expected = statement.first, "a separate statement"
        remedy = "anchor at another statement"
    else:
        got, line, expected = f"no {what} {place}", functions[0].line, _candidates(functions, verb)
        remedy = "write the name exactly as in the source"
    return MutatorError(got, where=file.where, line=line + 1, expected=expected, remedy=remedy)


def _what(verb: str, name: str) -> str:
    words = {"assign": "assignment to", "call": "call of", "return": "return of"}
    return f"{words[verb]} '{name}'" if name else "return"


def _candidates(functions: tuple[Function, ...], verb: str) -> str:
    candidates = [
        f"'{name}' (line {s.first + 1})" if name else f"line {s.first + 1}"
        for f in functions
        for s in f.statements
        if s.reason is None
        for name in s.names(verb)
    ]
    return (
        f"one of {', '.join(candidates)}"
        if candidates
        else "another kind of anchor: there is none of this kind"
    )


def _refuse_awkward(file: ParsedFile, anchor: Anchor, statement: Statement) -> None:
    after = anchor.kind in (AnchorKind.AFTER_ASSIGN, AnchorKind.AFTER_CALL)
    reason = None
    if statement.opens is not None and not after:
        reason = "is the head of a block"
    elif statement.one_line_suite:
        reason = "is on the line of its `if`, `for` or `def`"
    elif after and statement.is_return:
        reason = "returns, so nothing after it runs"
    elif after and not statement.last_in_line:
        reason = "shares its line with statements after it"
    elif not after and not statement.first_in_line:
        reason = "shares its line with statements before it"
    if reason:
        raise MutatorError(
            f"the anchored statement {reason}",
            where=file.where,
            line=statement.first + 1,
            expected="a statement that shares no line with others",
            remedy="anchor at another statement, or reformat the target",
        )
