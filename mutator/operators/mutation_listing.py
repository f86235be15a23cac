"""Lists all mutations of a function."""

import ast
from collections import Counter
from collections.abc import Collection, Iterator, Mapping

from mutator._common.doors import OPERATORS
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModels
from mutator.model import Anchor, AnchorKind, FaultLocation
from mutator.mutants.anchors import ParsedFile
from mutator.mutants.expressions import Expression, parts_of
from mutator.mutants.statements import Statement
from mutator.mutants.template_rendering import changed_value
from mutator.operators import Operator, Rule
from mutator.operators.mutations import Mutation
from mutator.operators.operator_lookup import find_operator
from mutator.operators.statement_facts import Facts

_Operators = Mapping[str, Operator]
LEFT_OUT = "left out"
_ID = "ffffffff"  # an id that no operator template writes
_UNCALCULATED = (ast.Yield, ast.YieldFrom)


def mutations_of(
    file: ParsedFile, facts: Facts, function: str, models: FaultModels, operators: Collection[str]
) -> list[Mutation]:
    """Return the mutations of all functions with that qualified name, by line, then by operator."""
    chosen = {name: find_operator(name) for name in operators}
    found = list(_of_values(file, facts, function, models, chosen))
    if any(operator.omits for operator in chosen.values()):
        found += _omissions(file, facts, function, chosen)
    return sorted(found, key=lambda one: (one.line, OPERATORS.place(one.operator)))


def _of_values(
    file: ParsedFile, facts: Facts, function: str, models: FaultModels, operators: _Operators
) -> Iterator[Mutation]:
    expressions = file.expressions.get(function, ())
    total = Counter(one.text for one in expressions)
    seen: Counter[str] = Counter()
    for expression in expressions:
        text = expression.text
        seen[text] += 1
        nth = seen[text] if total[text] > 1 else None
        anchor = Anchor(kind=AnchorKind.VALUE, name=text, nth=nth)
        location = FaultLocation(path=file.path, function=function, anchor=anchor)
        if any(isinstance(inner, _UNCALCULATED) for inner in ast.walk(expression.node)):
            continue  # templates refuse `yield`
        parts = None
        for name, rule in _rules(operators, expression, facts):
            parts = parts_of(expression) if parts is None else parts
            model = models.get(rule.model)
            yield Mutation(
                operator=name,
                location=location,
                model=rule.model,
                params=rule.params,
                place=expression,
                was=text,
                now=changed_value(model, dict(rule.params), _ID, expression.written, parts),
            )


def _rules(operators: _Operators, expression: Expression, facts: Facts) -> Iterator[tuple[str, Rule]]:
    for name, operator in operators.items():
        if operator.rules:
            with OPERATORS.running(name):
                for rule in operator.rules(expression, facts):
                    if not isinstance(rule, Rule):
                        raise TypeError(f"{rule!r} is no Rule")
                    yield name, rule


def _omissions(file: ParsedFile, facts: Facts, function: str, operators: _Operators) -> Iterator[Mutation]:
    every = ((f.line + 1, one) for f in file.functions.get(function, ()) for one in f.statements)
    found = [(line, one) for line, one in every if one.reason is None and one.opens is None]
    seen: Counter[tuple[str, str]] = Counter()
    for line, statement in found:
        anchored = None
        for verb in ("assign", "call"):
            for name in statement.names(verb):
                seen[verb, name] += 1
                anchored = anchored or (verb, name, seen[verb, name])
        if anchored is None or not _can_be_left_out(statement, facts, line):
            continue
        omitting = [name for name, one in operators.items() if _omits(name, one, statement, facts)]
        if not omitting:
            continue
        verb, name, number = anchored
        several = sum(name in one.names(verb) for _, one in found) > 1
        kind = AnchorKind.BEFORE_ASSIGN if verb == "assign" else AnchorKind.BEFORE_CALL
        anchor = Anchor(kind=kind, name=name, nth=number if several else None)
        location = FaultLocation(path=file.path, function=function, anchor=anchor)
        try:
            file.resolve(location)
        except MutatorError:
            continue  # LibCST and `ast` disagree on the place
        for operator in omitting:
            yield Mutation(
                operator=operator,
                location=location,
                model="omission",
                params=(),
                place=statement,
                was=facts.texts.get(statement.first + 1, name),
                now=LEFT_OUT,
            )


def _omits(name: str, operator: Operator, statement: Statement, facts: Facts) -> bool:
    with OPERATORS.running(name):
        return bool(operator.omits and operator.omits(statement, facts))


def _can_be_left_out(statement: Statement, facts: Facts, function: int) -> bool:
    """Return whether a statement can be omitted. The first binding of a local name cannot, because later
    uses of the name would fail.
    """
    if not statement.alone:
        return False
    names = [name for name in statement.assigns if name.isidentifier()]
    return all(facts.bound.get((function, name), 0) < statement.first + 1 for name in names)
