"""Mutation operators: classical mutants of a target's functions, as faults without a spec.

An operator is an `Operator`: in a module of `shipped/`, or from another package (entry points of the group
`mutator.operators`).
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mutator.model import Value

if TYPE_CHECKING:
    from mutator.mutants.changeable_expressions import Expression
    from mutator.mutants.function_statements import Statement
    from mutator.operators.statement_facts import StatementFacts


@dataclass(frozen=True, slots=True, kw_only=True)
class MutationRule:
    """A change of an expression: a fault model with parameters."""

    model: str
    params: tuple[tuple[str, Value], ...] = ()


def mutation_rule(model: str, **params: Value) -> MutationRule:
    return MutationRule(model=model, params=tuple(sorted(params.items())))


@dataclass(frozen=True, slots=True, kw_only=True)
class Operator:
    """A mutation operator.

    `rules` yields the changes of an expression. `omits` returns whether to leave out a statement, which is
    alone on its lines and is not the first to give a local name its value.

    `examples` are its tests. They map the body of `def f(self, a, b):` to all changes that the operator makes
    in it. `replacements` describe them on the reference page, in Markdown: where, and the replacement.

    With `needs_types`, golden runs measure the types of variables first. `all` leaves out an operator without
    `is_in_all`.
    """

    about: str
    replacements: tuple[tuple[str, str], ...]
    examples: Mapping[str, Sequence[str]]
    rules: "Callable[[Expression, StatementFacts], Iterable[MutationRule]] | None" = None
    needs_types: bool = False
    is_in_all: bool = True
    omits: "Callable[[Statement, StatementFacts], bool] | None" = None
