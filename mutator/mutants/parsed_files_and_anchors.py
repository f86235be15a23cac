"""Resolves anchors, such as an assignment in a function, to lines of a source file."""

import ast
from codecs import BOM_UTF8
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from mutator._common.interrupts import delaying_interrupts
from mutator._common.message_text import counted, spelling_suggestion
from mutator.errors import MutatorError
from mutator.model import LOAD_TIME_ANCHORS, VALUE_ANCHORS, Anchor, AnchorKind, FaultLocation
from mutator.mutants.changeable_expressions import Expression, list_expressions
from mutator.mutants.constants_and_defaults import (
    ConstantOrDefault,
    choose_constant_or_default,
    list_constants_and_defaults,
)
from mutator.mutants.expression_anchor_resolution import (
    choose_expression,
    describe_valid_nth,
    normalized_anchor_name,
)
from mutator.mutants.function_statements import Function, Statement, collect_functions
from mutator.mutants.logical_lines import LogicalLines
from mutator.mutants.name_scopes import normalize_identifier, used_names_by_function
from mutator.mutants.positions_of_both_parsers import NodePosition, ast_node_positions
from mutator.mutants.source_parsing import (
    check_line_ends_and_tags,
    import_insertion_line,
    parse_with_libcst,
    parse_with_python,
    translate_libcst_errors,
)
from mutator.mutants.standalone_function_compilation import list_outermost_function_lines
from mutator.targets.defence_lines import with_empty_defence_lines
from mutator.targets.source_tree import SourceTree


@dataclass(frozen=True, slots=True, kw_only=True)
class ResolvedAnchor:
    """A resolved anchor. The statement is on lines `first_line` to `end_line` (from 0, the last exclusive).

    An `entry` has no statement: the two are equal.
    """

    first_line: int
    end_line: int
    inserts_after: bool
    is_alone_on_line: bool
    indentable_line_count: (
        int  # lines that a guard can indent: all, or only the first if a string spans lines
    )
    indent: bytes
    names_used_in_function: frozenset[str]  # used in the function


@dataclass(frozen=True)
class ParsedFile:
    """A parsed file. Lines of defences are in `data` and `lines`, and empty in all that was parsed."""

    path: str
    data: bytes
    target_data: bytes  # with empty lines instead of those of defences
    lines: tuple[bytes, ...]  # without the byte order mark
    logical_lines: LogicalLines
    encoding: str
    newline: bytes
    indent_unit: bytes
    import_insertion_line_index: int  # the import of the probe is inserted before this line
    functions_by_name: Mapping[str, tuple[Function, ...]]
    ast_positions: frozenset[NodePosition]  # according to `ast`
    expressions_by_function: Mapping[str, tuple[Expression, ...]]  # by function
    constants_and_defaults: tuple[ConstantOrDefault, ...]
    outermost_function_lines: tuple[range, ...]  # the lines of each outermost function
    full_path: Path
    syntax_tree: ast.Module = field(repr=False, compare=False)
    verified_edits: set[Hashable] = field(
        default_factory=set, repr=False, compare=False
    )  # edits that passed checks
    _resolved_anchors: dict[tuple[str, Anchor], ResolvedAnchor] = field(
        default_factory=dict, repr=False, compare=False
    )

    def resolve_expression(self, location: FaultLocation) -> Expression:
        """Return the expression at the location; MutatorError with candidates unless exactly one matches."""
        functions = functions_named(self, location.function)
        expressions = self.expressions_by_function.get(normalized_function_name(location.function), ())
        return choose_expression(expressions, location, self.full_path, functions[0].def_line)

    def resolve_constant_or_default(self, location: FaultLocation) -> ConstantOrDefault:
        """Return the constant or default at the location; MutatorError with candidates if there is none."""
        if location.function:
            functions_named(self, location.function)
        return choose_constant_or_default(self.constants_and_defaults, location, self.full_path)

    def line_span(self, location: FaultLocation) -> tuple[int, int]:
        """Return the lines of the statement or value at the location (from 0, the last exclusive)."""
        if location.anchor.kind in VALUE_ANCHORS:
            expression = self.resolve_expression(location)
            return expression.start[0], expression.end[0] + 1
        if location.anchor.kind in LOAD_TIME_ANCHORS:
            fixed = self.resolve_constant_or_default(location)
            return fixed.first_line, fixed.end_line
        anchor = self.resolve_statement(location)
        return anchor.first_line, anchor.end_line

    def outermost_function_at(self, line: int) -> range | None:
        """Return the lines of the outermost function that contains this line (from 0)."""
        return next((lines for lines in self.outermost_function_lines if line in lines), None)

    def names_used_in_function_at(self, location: FaultLocation) -> frozenset[str]:
        """Return the names used in the function that contains the location."""
        if location.anchor.kind not in VALUE_ANCHORS:
            return self.resolve_statement(location).names_used_in_function
        line = self.resolve_expression(location).start[0]
        above = [
            function for function in functions_named(self, location.function) if function.def_line <= line
        ]
        return max(above, key=lambda function: function.def_line).used_names

    def resolve_statement(self, location: FaultLocation) -> ResolvedAnchor:
        """Return the statement at the location; MutatorError with candidates unless exactly one matches."""
        key = (location.function, location.anchor)
        if key not in self._resolved_anchors:
            self._resolved_anchors[key] = _resolve_statement(self, location)
        return self._resolved_anchors[key]


def parsed_file(tree: SourceTree, path: str) -> ParsedFile:
    """Parse the file only once; MutatorError if it is not a Python file of the target."""
    return tree.derive_once(path, parse_file, with_defence_lines=True)


@lru_cache(maxsize=64)  # planning, checks and report each read the tree
@delaying_interrupts()
def parse_file(path: str, data: bytes, root: Path) -> ParsedFile:
    """Parse a file of the target; MutatorError if it is not Python, or already has injected lines."""
    where = root / path
    defended, data = data, with_empty_defence_lines(data)
    check_line_ends_and_tags(data, where)
    tree = parse_with_python(data, where)
    with translate_libcst_errors(where):
        module, positions = parse_with_libcst(data, where)
        logical_lines = LogicalLines.of(data)
        return ParsedFile(
            path=path,
            data=defended,
            target_data=data,
            lines=tuple(defended.removeprefix(BOM_UTF8).splitlines(keepends=True)),
            logical_lines=logical_lines,
            encoding=module.encoding.removesuffix("-sig"),
            newline=module.default_newline.encode(),
            # a form feed would begin the line anew
            indent_unit=module.default_indent.rpartition("\f")[2].encode() or b"    ",
            import_insertion_line_index=import_insertion_line(module, positions, logical_lines),
            functions_by_name=collect_functions(module, positions, used_names_by_function(data)),
            expressions_by_function=list_expressions(data, tree, module, positions),
            constants_and_defaults=list_constants_and_defaults(data, tree, logical_lines),
            outermost_function_lines=tuple(list_outermost_function_lines(tree)),
            ast_positions=ast_node_positions(tree),
            full_path=where,
            syntax_tree=tree,
        )


def normalized_function_name(function: str) -> str:
    """Return a function's qualified name without `<locals>`, normalized as the compiler does."""
    return normalize_identifier(function.replace(".<locals>", ""))


def functions_named(file: ParsedFile, function: str) -> tuple[Function, ...]:
    """Return the functions with that qualified name; MutatorError with candidates if there is none."""
    name = normalized_function_name(function)
    functions = file.functions_by_name.get(name)
    if not functions:
        names = list(file.functions_by_name)
        raise MutatorError(
            f"no function '{function}'",
            where=file.full_path,
            expected=f"a function of the file: {', '.join(names) or 'it has none'}",
            remedy="correct the qualified name" + spelling_suggestion(name, names),
        )
    return functions


def _resolve_statement(file: ParsedFile, location: FaultLocation) -> ResolvedAnchor:
    functions = functions_named(file, location.function)
    if location.anchor.kind is AnchorKind.ENTRY:
        return _resolve_function_entry(file, location, functions)
    function, statement = _choose_statement(file, location, functions)
    _check_anchor_fits_statement(file, location.anchor, statement)
    _check_position_matches_ast(file, statement.position)
    if statement.block_start_of_head_binding is not None:
        return _resolve_block_start(file, statement.block_start_of_head_binding, function.used_names)
    first = statement.first_line
    return ResolvedAnchor(
        first_line=first,
        end_line=statement.end_line,
        inserts_after=location.anchor.kind in (AnchorKind.AFTER_ASSIGN, AnchorKind.AFTER_CALL),
        is_alone_on_line=statement.is_alone,
        indentable_line_count=1 if statement.has_multiline_string else statement.end_line - first,
        indent=_indentation_at(file, first),
        names_used_in_function=function.used_names,
    )


def _resolve_block_start(file: ParsedFile, first_line: int, names: frozenset[str]) -> ResolvedAnchor:
    indent = _indentation_at(file, first_line)
    first_line = file.logical_lines.start_of(first_line)
    return ResolvedAnchor(
        first_line=first_line,
        end_line=first_line,
        inserts_after=True,
        is_alone_on_line=True,
        indentable_line_count=0,
        indent=indent,
        names_used_in_function=names,
    )


def _check_position_matches_ast(file: ParsedFile, position: NodePosition | None) -> None:
    if (
        position is not None
        and position.with_byte_columns(file.lines, file.encoding) not in file.ast_positions
    ):
        raise MutatorError(
            "LibCST and Python's own parser give different positions for this statement",
            where=file.full_path,
            line=position.start[0],
            expected="the same position from both",
            remedy="anchor at another statement, or reformat the target",
        )


def _indentation_at(file: ParsedFile, first_line: int) -> bytes:
    """Return the indentation of the statement that begins on this line, or further up with a backslash."""
    line = file.lines[file.logical_lines.start_of(first_line)]
    return line[: len(line) - len(line.lstrip(b" \t\f"))]


def _resolve_function_entry(
    file: ParsedFile, location: FaultLocation, functions: tuple[Function, ...]
) -> ResolvedAnchor:
    nth = location.anchor.nth
    if (len(functions) > 1) if nth is None else (nth > len(functions)):
        places = ", ".join(f"line {f.def_line + 1}" for f in functions)
        raise MutatorError(
            f"{counted(len(functions), 'function')} named '{location.function}'"
            + (f", but `nth` is {nth}" if nth else ""),
            where=file.full_path,
            line=functions[0].def_line + 1,
            expected=f"one of those at {places}" if len(functions) > 1 else f"the one at {places}",
            remedy=f"give `nth`, {describe_valid_nth(len(functions))}",
        )
    function = functions[(nth or 1) - 1]
    if function.entry_and_indent_lines is None:
        raise MutatorError(
            f"nothing can be inserted at the entry of function '{location.function}'",
            where=file.full_path,
            line=function.def_line + 1,
            expected="a body below the `def` line, and nothing else on the docstring's lines",
            remedy="anchor somewhere else, or reformat the target",
        )
    _check_position_matches_ast(file, function.position)
    index, model_line = function.entry_and_indent_lines
    if index == model_line:
        index = model_line = file.logical_lines.start_of(index)
    return ResolvedAnchor(
        first_line=index,
        end_line=index,
        inserts_after=index != model_line,
        is_alone_on_line=True,
        indentable_line_count=0,
        indent=_indentation_at(file, model_line),
        names_used_in_function=function.used_names,
    )


def _choose_statement(
    file: ParsedFile, location: FaultLocation, functions: tuple[Function, ...]
) -> tuple[Function, Statement]:
    anchor = location.anchor
    verb = anchor.kind.partition("_")[2]
    name = normalized_anchor_name(anchor.name)
    pairs = [(f, s) for f in functions for s in f.statements_by_name.get((verb, name), ())]
    # heads of blocks are numbered last, so that `nth` in older specs selects the same statements
    matches = sorted(
        (pair for pair in pairs if pair[1].unanchorable_reason is None),
        key=lambda pair: pair[1].block_start_of_head_binding is not None,
    )
    statements = sum(s.block_start_of_head_binding is None for _, s in matches)
    nth = anchor.nth
    # one statement is no ambiguity, even if heads of blocks bind the same name
    if matches and (1 in (len(matches), statements) if nth is None else nth <= len(matches)):
        return matches[(nth or 1) - 1]
    raise _ambiguous_or_missing_error(file, location, functions, pairs, matches)


def _ambiguous_or_missing_error(
    file: ParsedFile,
    location: FaultLocation,
    functions: tuple[Function, ...],
    pairs: list[tuple[Function, Statement]],
    matches: list[tuple[Function, Statement]],
) -> MutatorError:
    """Return the error about an ambiguous or missing anchor.

    `pairs` are all matches of the name, `matches` those that are whole statements or heads of blocks.
    """
    anchor = location.anchor
    verb = anchor.kind.partition("_")[2]
    what, place = _describe_anchor(verb, anchor.name), f"in {location.function}"
    if matches:
        lines = ", ".join(str(s.first_line + 1) for _, s in matches)
        nth_range = describe_valid_nth(len(matches))
        statement_count = counted(len(matches), "statement")
        got = f"{what} matches {statement_count} {place}: {'lines' if len(matches) > 1 else 'line'} {lines}"
        remedy = (
            f"give `nth`, {nth_range}" if anchor.nth is None else f"`nth` is {anchor.nth}: give {nth_range}"
        )
        line, expected = matches[0][1].first_line, "exactly one"
    elif pairs:
        statement = pairs[0][1]
        got = f"{what} {place} is not a separate statement: {statement.unanchorable_reason}"
        line, expected = statement.first_line, "a separate statement"
        remedy = "anchor at another statement"
    else:
        got, line, expected = (
            f"no {what} {place}",
            functions[0].def_line,
            _describe_candidates(functions, verb),
        )
        remedy = "write the name exactly as in the source"
    return MutatorError(got, where=file.full_path, line=line + 1, expected=expected, remedy=remedy)


def _describe_anchor(verb: str, name: str) -> str:
    words = {"assign": "assignment to", "call": "call of", "return": "return of"}
    return f"{words[verb]} '{name}'" if name else "return"


def _describe_candidates(functions: tuple[Function, ...], verb: str) -> str:
    candidates = [
        f"'{name}' (line {s.first_line + 1})" if name else f"line {s.first_line + 1}"
        for f in functions
        for s in f.statements
        if s.unanchorable_reason is None
        for name in s.names_for(verb)
    ]
    return (
        f"one of {', '.join(candidates)}"
        if candidates
        else "another kind of anchor: there is none of this kind"
    )


def _check_anchor_fits_statement(file: ParsedFile, anchor: Anchor, statement: Statement) -> None:
    after = anchor.kind in (AnchorKind.AFTER_ASSIGN, AnchorKind.AFTER_CALL)
    reason = None
    if statement.block_start_of_head_binding is not None and not after:
        reason = "is the head of a block"
    elif statement.is_in_one_line_suite:
        reason = "is on the line of its `if`, `for` or `def`"
    elif after and statement.is_return:
        reason = "returns, so nothing after it runs"
    elif after and not statement.is_last_in_line:
        reason = "shares its line with statements after it"
    elif not after and not statement.is_first_in_line:
        reason = "shares its line with statements before it"
    elif not after and file.logical_lines.start_of(statement.first_line) != statement.first_line:
        reason = "begins below a line with only a backslash"
    if reason:
        raise MutatorError(
            f"the anchored statement {reason}",
            where=file.full_path,
            line=statement.first_line + 1,
            expected="a statement that shares no line with others",
            remedy="anchor at another statement, or reformat the target",
        )
