"""Compiles the statement that a mutation changes, without the rest of its function.

Compiling the whole function for each mutation would take time that grows with the square of the function's
size. What a statement compiles to depends on no other statement, except for the numbers that the compiler
gives to names and constants. So two mutations of a statement give the whole function equal code if and only
if they give the statement equal code. In long displays and calls, the same holds for each element. None
instead of code means that only the code of the whole function can tell.
"""

import ast
from bisect import bisect_left
from collections import Counter
from collections.abc import Hashable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from dis import get_instructions
from types import CodeType

from mutator.engines.code_swap_planning import behaviour_key, nested_code
from mutator.mutants.changeable_expressions import Expression
from mutator.mutants.parsed_files_and_anchors import ParsedFile
from mutator.operators.mutations import Mutation

_FEWEST_LONG_ELEMENTS = 9  # shorter displays and calls are compiled whole
# below other nodes, the compiler folds a tuple of constants further, so its elements do not count one by one
_PARENTS_THAT_KEEP_TUPLES = (
    ast.Assign | ast.AnnAssign | ast.Return | ast.List | ast.Tuple | ast.Dict | ast.Call | ast.keyword
)
_Position = tuple[int, int]  # line from 1, column in bytes


@dataclass(frozen=True, slots=True)
class _StepToChild:
    """The way from a node to a child: the node's field, and the index in it if the field is a list."""

    node: ast.AST
    field: str
    index: int | None

    @property
    def child(self) -> ast.AST:
        value = getattr(self.node, self.field)
        child: ast.AST = value if self.index is None else value[self.index]
        return child

    @property
    def is_into_long_node(self) -> bool:
        return (
            self.index is not None
            and isinstance(self.node, ast.List | ast.Tuple | ast.Dict | ast.Call)
            and len(getattr(self.node, self.field)) >= _FEWEST_LONG_ELEMENTS
        )


@dataclass(frozen=True, slots=True)
class ChangeablePart:
    """The smallest part of a function whose code a mutation changes: a statement, or an element in it.

    `steps` go from the statement to the changed expression, through the elements of long nodes at
    `step_indices_into_long_nodes`. Mutations of different parts give equal code only if they give the
    original's.
    """

    statement: ast.stmt
    steps: tuple[_StepToChild, ...] = ()
    step_indices_into_long_nodes: tuple[int, ...] = ()

    @property
    def is_in_condition(self) -> bool:
        return any(step.field in ("test", "ifs") or isinstance(step.node, ast.BoolOp) for step in self.steps)

    def statement_with(self, child: ast.AST) -> ast.stmt:
        """Return the statement with `child` at the end of the steps, without what has its own code."""
        for i, step in reversed([*enumerate(self.steps)]):
            child = _with_child(step, child, alone=i in self.step_indices_into_long_nodes)
        assert isinstance(child, ast.stmt)
        return _head_of(child)

    @property
    def key(self) -> Hashable:
        elements = (self.steps[i] for i in self.step_indices_into_long_nodes)
        return id(self.statement), *((id(step.node), step.field, step.index) for step in elements)


class ChangeableParts:
    """The code of the statements of a file, as they are and with mutations."""

    def __init__(self, file: ParsedFile) -> None:
        self._step_to_child: dict[int, _StepToChild] = {}  # by the child's id, as the other two
        self._simple_statement_by_line: dict[int, ast.stmt] = {}
        self._statements_in_async_functions: set[int] = set()
        self._nonlocal_names: set[str] = set()
        self._note_nodes(file.syntax_tree)
        code = compile(file.syntax_tree, "<file>", "exec", dont_inherit=True)
        self._instruction_starts = sorted(set(_instruction_starts(code)))

    def _note_nodes(self, tree: ast.Module) -> None:
        remaining: list[tuple[ast.AST, bool]] = [(tree, False)]
        while remaining:
            node, is_in_async = remaining.pop()
            if isinstance(node, ast.stmt):
                if is_in_async:
                    self._statements_in_async_functions.add(id(node))
                if not hasattr(node, "body"):
                    self._simple_statement_by_line[node.lineno] = node
            if isinstance(node, ast.Nonlocal):
                self._nonlocal_names.update(node.names)
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                is_in_async = isinstance(node, ast.AsyncFunctionDef)
            for step in _steps_from(node):
                self._step_to_child[id(step.child)] = step
                remaining.append((step.child, is_in_async))

    def part_of(self, mutation: Mutation) -> ChangeablePart:
        target = mutation.mutated_part
        if not isinstance(target, Expression):
            return ChangeablePart(self._simple_statement_by_line[target.first_line + 1])
        steps: list[_StepToChild] = []
        node: ast.AST = target.node
        while not isinstance(node, ast.stmt):
            steps.append(self._step_to_child[id(node)])
            node = steps[-1].node
        steps.reverse()
        long = [
            i for i, step in enumerate(steps) if step.is_into_long_node and _elements_count(steps[: i + 1])
        ]
        return ChangeablePart(node, tuple(steps), tuple(long))

    def compared_codes(self, changes: Sequence[tuple[ChangeablePart, Mutation]]) -> list[Hashable] | None:
        """Return what to compare of one part's code: first of the original, then of each mutation."""
        part = changes[0][0]
        unchanged = part.statement_with(part.steps[-1].child if part.steps else part.statement)
        if not self._is_reachable(part.statement) or _has_constant_condition(unchanged):
            return None
        codes = [self._compiled(part, unchanged, may_drop_code=False)]
        codes += [self._mutated_code(changed_part, mutation) for changed_part, mutation in changes]
        certain_codes = [code for code in codes if code is not None]
        if len(certain_codes) < len(codes) or _may_differ_in_dropped_code(certain_codes):
            return None
        return [code.behaviour for code in certain_codes]

    def _mutated_code(self, part: ChangeablePart, mutation: Mutation) -> "_PartCode | None":
        if not part.steps:
            return None if self._binds_nonlocal(part.statement) else _PartCode(None, may_drop_code=False)
        try:
            changed = ast.parse(f"({mutation.source_after})", mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            return None
        statement = part.statement_with(ast.increment_lineno(changed, mutation.line))
        return self._compiled(part, statement, may_drop_code=part.is_in_condition and _is_constant(changed))

    def _compiled(
        self, part: ChangeablePart, statement: ast.stmt, *, may_drop_code: bool
    ) -> "_PartCode | None":
        is_async = id(part.statement) in self._statements_in_async_functions
        module = ast.parse(f"{'async ' if is_async else ''}def f(): _")
        [function] = module.body
        assert isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef)
        function.body = [statement, _placeholder_statement(statement)]
        try:
            code = compile(module, "<statement>", "exec", dont_inherit=True)
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            return None
        [function_code] = nested_code(code)
        return _PartCode(function_code, may_drop_code=may_drop_code)

    def _is_reachable(self, statement: ast.stmt) -> bool:
        start, end = (statement.lineno, statement.col_offset), _end_of_head(statement)
        first = bisect_left(self._instruction_starts, start)
        return first < len(self._instruction_starts) and self._instruction_starts[first] < end

    def _binds_nonlocal(self, statement: ast.stmt) -> bool:
        """Return whether an inner function could lack the variable if the statement were omitted."""
        names = (node.id for node in ast.walk(statement) if isinstance(node, ast.Name))
        return not self._nonlocal_names.isdisjoint(names)


def _steps_from(node: ast.AST) -> Iterator[_StepToChild]:
    for field, value in ast.iter_fields(node):
        if isinstance(value, list):
            yield from (
                _StepToChild(node, field, i) for i, child in enumerate(value) if isinstance(child, ast.AST)
            )
        elif isinstance(value, ast.AST):
            yield _StepToChild(node, field, None)


def _elements_count(steps: list[_StepToChild]) -> bool:
    """Return whether each element of the last step's node counts by itself."""
    inner = next((i for i in reversed(range(len(steps))) if not isinstance(steps[i].node, ast.Tuple)), -1)
    return inner == len(steps) - 1 or isinstance(steps[inner].node, _PARENTS_THAT_KEEP_TUPLES)


def _with_child(step: _StepToChild, child: ast.AST, *, alone: bool) -> ast.AST:
    """Return a copy of the step's node with another child; `alone`: without its other elements."""
    node = copy(step.node)
    if step.index is None:
        setattr(node, step.field, child)
        return node
    if alone:
        for field, children in ast.iter_fields(step.node):
            if isinstance(children, list):
                is_key_or_value = isinstance(node, ast.Dict)
                setattr(node, field, children[step.index : step.index + 1] if is_key_or_value else [])
        setattr(node, step.field, [child])
    else:
        children = [*getattr(step.node, step.field)]
        children[step.index] = child
        setattr(node, step.field, children)
    return node


def _head_of(statement: ast.stmt) -> ast.stmt:
    """Return a compound statement with a placeholder as its only body, and other statements unchanged."""
    if not hasattr(statement, "body"):
        return statement
    head = copy(statement)
    for field in {"body", "orelse"}.intersection(statement._fields):
        setattr(head, field, [_placeholder_statement(statement)] if field == "body" else [])
    return head


def _placeholder_statement(statement: ast.stmt) -> ast.stmt:
    """Return a statement below `statement` that surely is compiled to something."""
    line = (statement.end_lineno or statement.lineno) + 1
    [placeholder] = ast.parse("_").body
    return ast.increment_lineno(placeholder, line - 1)


def _end_of_head(statement: ast.stmt) -> _Position:
    body = getattr(statement, "body", None)
    if body:
        return body[0].lineno, body[0].col_offset
    return statement.end_lineno or statement.lineno, statement.end_col_offset or 0


def _instruction_starts(code: CodeType) -> Iterator[_Position]:
    for line, _, column, _ in code.co_positions():
        if line is not None and column is not None:
            yield line, column
    for inner in nested_code(code):
        yield from _instruction_starts(inner)


@dataclass(frozen=True, slots=True)
class _PartCode:
    """The code of a part, None if the statement is omitted.

    `may_drop_code`: a condition in it is constant, so the compiler can drop code. What remains of that code,
    in the tables of names and constants, depends on the whole function.
    """

    code: CodeType | None
    may_drop_code: bool

    @property
    def behaviour(self) -> Hashable:
        return behaviour_key(self.code) if self.code else "omitted"

    @property
    def instructions(self) -> Hashable:
        return tuple(_instructions_in(self.code)) if self.code else "omitted"


def _may_differ_in_dropped_code(codes: Sequence[_PartCode]) -> bool:
    """Return whether codes with equal instructions here might differ in the function, or vice versa."""
    if not any(code.may_drop_code for code in codes):
        return False
    instructions = [code.instructions for code in codes]
    totals = Counter(instructions)
    return any(code.may_drop_code and totals[key] > 1 for code, key in zip(codes, instructions, strict=True))


def _instructions_in(code: CodeType) -> Iterator[tuple[str, str]]:
    for instruction in get_instructions(code):
        if not isinstance(instruction.argval, CodeType):
            yield instruction.opname, instruction.argrepr
    for inner in nested_code(code):
        yield from _instructions_in(inner)


def _has_constant_condition(statement: ast.stmt) -> bool:
    """Return whether a condition in the statement is constant. Patterns of `match` count as constants."""
    conditions = [getattr(statement, "test", None)]
    for node in ast.walk(statement):
        match node:
            case ast.IfExp(test=test):
                conditions.append(test)
            case ast.BoolOp(values=values) | ast.comprehension(ifs=values):
                conditions += values
            case ast.Match():
                return True
    return any(_is_constant(condition) for condition in conditions if condition)


def _is_constant(node: ast.AST) -> bool:
    return not any(
        isinstance(inner, ast.Call) or (isinstance(inner, ast.Name) and inner.id != "__debug__")
        for inner in ast.walk(node)
    )
