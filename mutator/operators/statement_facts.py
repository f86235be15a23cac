"""Collects the facts about a file's statements that operators need, using `ast`."""

import ast
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from mutator.mutants.expression_roles import blocks
from mutator.targets.source_tree import SourceTree

Extent = tuple[int, int, int | None, int | None]

_OWN_NAMES: dict[type[ast.AST], str] = {ast.comprehension: "target", ast.Lambda: "body"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """Facts about the statements of a file's functions. Line numbers start at 1.

    * `augmented`: the operator of an augmented assignment, by the extent of its right-hand side
    * `texts`: the source of simple statements, by first line
    * `bound`: the line that first binds a name in a function. The key has the function's `def` line, because
      a property and its setter share a name
    * `own`: the lines of each statement without those of nested statements
    """

    augmented: dict[Extent, ast.operator] = field(default_factory=dict)
    texts: dict[int, str] = field(default_factory=dict)
    bound: dict[tuple[int, str], int] = field(default_factory=dict)
    own: list[range] = field(default_factory=list)

    def executed(self, lines: Collection[int]) -> frozenset[int]:
        """Extend the lines to whole statements."""
        ran = [own for own in self.own if any(line in lines for line in own)]
        return frozenset(lines).union(*ran)


def extent(node: ast.expr) -> Extent:
    return node.lineno, node.col_offset, node.end_lineno, node.end_col_offset


def facts_of(tree: SourceTree, path: str) -> Facts:
    return tree.derived(path, _facts)


def _facts(path: str, data: bytes, root: Path) -> Facts:
    facts = Facts()
    _block(ast.parse(data).body, None, facts)
    return facts


def _block(body: list[ast.stmt], function: int | None, facts: Facts) -> None:
    for statement in body:
        if function is not None:
            _statement(statement, function, facts)
        if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef):
            for argument in _arguments(statement.args):
                facts.bound.setdefault((statement.lineno, argument.arg), statement.lineno)
            _block(statement.body, statement.lineno, facts)
        elif isinstance(statement, ast.ClassDef):
            _block(statement.body, None, facts)
        else:
            for block in blocks(statement):
                _block(block, function, facts)


def _arguments(arguments: ast.arguments) -> Iterator[ast.arg]:
    yield from (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)
    yield from (one for one in (arguments.vararg, arguments.kwarg) if one)


def _statement(statement: ast.stmt, function: int, facts: Facts) -> None:
    inner = [block[0].lineno for block in blocks(statement) if block]
    last = statement.end_lineno or statement.lineno
    facts.own.append(range(statement.lineno, max(statement.lineno, min([last, *(n - 1 for n in inner)])) + 1))
    if not inner:
        facts.texts.setdefault(statement.lineno, ast.unparse(statement))
    if isinstance(statement, ast.AugAssign):
        facts.augmented[extent(statement.value)] = statement.op
    if isinstance(statement, ast.Global | ast.Nonlocal):
        for name in statement.names:
            facts.bound[function, name] = 0
    for node in _own_nodes(statement):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            facts.bound.setdefault((function, node.id), statement.lineno)


def _own_nodes(statement: ast.stmt) -> Iterator[ast.AST]:
    """Yield a statement's nodes, except nested statements and names local to comprehensions and lambdas."""
    todo: list[ast.AST] = [statement]
    while todo:
        node = todo.pop()
        yield node
        own = _OWN_NAMES.get(type(node))
        hidden = getattr(node, own) if own else None
        todo += [
            child
            for child in ast.iter_child_nodes(node)
            if child is not hidden and not isinstance(child, ast.stmt)
        ]
