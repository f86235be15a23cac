"""Collects the facts about a file's statements that operators need, using `ast`."""

import ast
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from mutator.mutants.expression_roles import blocks_of
from mutator.operators.interchangeable_variables import FunctionNames, TypesByName, names_of_functions
from mutator.targets.source_tree import SourceTree

_LOGGER_METHODS = frozenset(
    {"debug", "info", "warn", "warning", "error", "exception", "critical", "fatal", "log", "trace"}
)
# `log`, `self._logger`, `logging.getLogger(name)`, openpilot's `cloudlog`; not `dialog`
_LOGGER_PATTERN = re.compile(
    r"(?:^|[._]|cloud|get)log(?:ger|ging)?(?:\(.*\))?$|^warnings$", re.IGNORECASE | re.DOTALL
)
NodeExtent = tuple[int, int, int | None, int | None]

# these bind names of their own scope, which are no locals of the function
_LOCAL_NAME_FIELDS: dict[type[ast.AST], str] = {ast.comprehension: "target", ast.Lambda: "body"}


@dataclass(frozen=True, slots=True, kw_only=True)
class StatementFacts:
    """Facts about the statements of a file's functions. Line numbers start at 1.

    * `augmenting_operator_by_extent`: of augmented assignments, by the extent of the right-hand side
    * `source_by_line`: the source of simple statements, by first line
    * `first_binding_line_by_name`: in a function. The key has its `def` line, because a property and its
      setter share a name
    * `statement_lines`: the lines of each statement without those of nested statements
    * `function_names`: the local names of each function
    * `logged_name_extents`: the extents of names in arguments of loggers and `print`, which control nothing
    * `types_by_line`: the types of variables in golden runs, by the line that then begins; None without runs
    """

    augmenting_operator_by_extent: dict[NodeExtent, ast.operator] = field(default_factory=dict)
    source_by_line: dict[int, str] = field(default_factory=dict)
    first_binding_line_by_name: dict[tuple[int, str], int] = field(default_factory=dict)
    statement_lines: list[range] = field(default_factory=list)
    function_names: tuple[FunctionNames, ...] = ()
    logged_name_extents: frozenset[NodeExtent] = frozenset()
    types_by_line: Mapping[int, TypesByName] | None = None

    def types_at(self, line: int) -> TypesByName | None:
        """Return the types of variables where the statement on a line begins; None without golden runs."""
        if self.types_by_line is None:
            return None
        around = [lines for lines in self.statement_lines if line in lines]
        lines = min(around, key=len, default=range(line, line + 1))
        return next((self.types_by_line[n] for n in lines if n in self.types_by_line), {})

    def extend_to_statements(self, lines: Collection[int]) -> frozenset[int]:
        """Extend the lines to whole statements."""
        executed_statements = [
            statement for statement in self.statement_lines if any(line in lines for line in statement)
        ]
        return frozenset(lines).union(*executed_statements)


def extent_of(node: ast.expr) -> NodeExtent:
    return node.lineno, node.col_offset, node.end_lineno, node.end_col_offset


def statement_facts_of(tree: SourceTree, path: str) -> StatementFacts:
    return tree.derive_once(path, _collect_facts)


def _collect_facts(path: str, data: bytes, root: Path) -> StatementFacts:
    module = ast.parse(data)
    reported = (name for node in ast.walk(module) for name in _names_in_log_calls(node))
    facts = StatementFacts(
        function_names=names_of_functions(module), logged_name_extents=frozenset(map(extent_of, reported))
    )
    _collect_block(module.body, None, facts)
    return facts


def _names_in_log_calls(node: ast.AST) -> Iterator[ast.Name]:
    """Yield the names in the arguments of a call such as `self.logger.info(...)`, `print(...)`."""
    match node:
        case ast.Call(func=ast.Name(id="print")):
            pass
        case ast.Call(func=ast.Attribute(value=owner, attr=method)) if (
            method in _LOGGER_METHODS and _LOGGER_PATTERN.search(ast.unparse(owner))
        ):
            pass
        case _:
            return
    parts = (part for argument in (*node.args, *node.keywords) for part in ast.walk(argument))
    yield from (part for part in parts if isinstance(part, ast.Name))


def _collect_block(body: list[ast.stmt], def_line: int | None, facts: StatementFacts) -> None:
    for statement in body:
        if def_line is not None:
            _collect_statement(statement, def_line, facts)
        if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef):
            for argument in _all_arguments(statement.args):
                facts.first_binding_line_by_name.setdefault(
                    (statement.lineno, argument.arg), statement.lineno
                )
            _collect_block(statement.body, statement.lineno, facts)
        elif isinstance(statement, ast.ClassDef):
            _collect_block(statement.body, None, facts)
        else:
            for block in blocks_of(statement):
                _collect_block(block, def_line, facts)


def _all_arguments(arguments: ast.arguments) -> Iterator[ast.arg]:
    yield from (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)
    yield from (argument for argument in (arguments.vararg, arguments.kwarg) if argument)


def _collect_statement(statement: ast.stmt, def_line: int, facts: StatementFacts) -> None:
    inner = [block[0].lineno for block in blocks_of(statement) if block]
    last = statement.end_lineno or statement.lineno
    facts.statement_lines.append(
        range(statement.lineno, max(statement.lineno, min([last, *(n - 1 for n in inner)])) + 1)
    )
    if not inner:
        facts.source_by_line.setdefault(statement.lineno, ast.unparse(statement))
    if isinstance(statement, ast.AugAssign):
        facts.augmenting_operator_by_extent[extent_of(statement.value)] = statement.op
    if isinstance(statement, ast.Global | ast.Nonlocal):
        for name in statement.names:
            facts.first_binding_line_by_name[def_line, name] = 0
    if isinstance(statement, ast.AnnAssign) and statement.value is None:
        return  # `x: int` declares a name, but binds none
    for node in _nodes_in_scope(statement):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            facts.first_binding_line_by_name.setdefault((def_line, node.id), statement.lineno)


def _nodes_in_scope(statement: ast.stmt) -> Iterator[ast.AST]:
    """Yield a statement's nodes, except nested statements and names local to comprehensions and lambdas."""
    stack: list[ast.AST] = [statement]
    while stack:
        node = stack.pop()
        yield node
        local_field = _LOCAL_NAME_FIELDS.get(type(node))
        hidden = getattr(node, local_field) if local_field else None
        stack += [
            child
            for child in ast.iter_child_nodes(node)
            if child is not hidden and not isinstance(child, ast.stmt)
        ]
