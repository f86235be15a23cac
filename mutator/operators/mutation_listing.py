"""Lists all mutations of a function."""

import ast
from collections import Counter
from collections.abc import Collection, Iterator, Mapping

from mutator._common.extension_doors import OPERATOR_DOOR
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModels
from mutator.model import Anchor, AnchorKind, FaultLocation
from mutator.mutants.changeable_expressions import Expression, template_parts
from mutator.mutants.function_statements import Statement
from mutator.mutants.parsed_files_and_anchors import ParsedFile
from mutator.mutants.template_rendering import render_changed_value
from mutator.operators import MutationRule, Operator
from mutator.operators.mutations import Mutation
from mutator.operators.operator_lookup import find_operator
from mutator.operators.statement_facts import StatementFacts

_OperatorByName = Mapping[str, Operator]
LEFT_OUT_TEXT = "left out"
_PLACEHOLDER_ID = "ffffffff"  # an id that no operator template writes
_YIELD_NODES = (ast.Yield, ast.YieldFrom)


def mutations_of(
    file: ParsedFile, facts: StatementFacts, function: str, models: FaultModels, operators: Collection[str]
) -> list[Mutation]:
    """Return the mutations of all functions with that qualified name, by line, then by operator."""
    operator_by_name = {name: find_operator(name) for name in operators}
    mutations = list(_expression_mutations(file, facts, function, models, operator_by_name))
    if any(operator.omits for operator in operator_by_name.values()):
        mutations += _omission_mutations(file, facts, function, operator_by_name)
    return sorted(mutations, key=lambda mutation: (mutation.line, OPERATOR_DOOR.sort_key(mutation.operator)))


def _expression_mutations(
    file: ParsedFile, facts: StatementFacts, function: str, models: FaultModels, operators: _OperatorByName
) -> Iterator[Mutation]:
    expressions = file.expressions_by_function.get(function, ())
    totals = Counter(e.anchor_name for e in expressions)
    numbers: Counter[str] = Counter()
    for expression in expressions:
        text = expression.anchor_name
        numbers[text] += 1
        nth = numbers[text] if totals[text] > 1 else None
        anchor = Anchor(kind=AnchorKind.VALUE, name=text, nth=nth)
        location = FaultLocation(path=file.path, function=function, anchor=anchor)
        if any(isinstance(inner, _YIELD_NODES) for inner in ast.walk(expression.node)):
            continue  # templates refuse `yield`
        parts = None
        for name, rule in _rules_for(operators, expression, facts):
            parts = template_parts(expression) if parts is None else parts
            model = models.get(rule.model)
            source_after = render_changed_value(
                model, dict(rule.params), _PLACEHOLDER_ID, expression.one_line_source, parts
            )
            if not _is_encodable(source_after, file.encoding):
                continue  # an escaped character that the file's encoding lacks
            yield Mutation(
                operator=name,
                location=location,
                model=rule.model,
                params=rule.params,
                mutated_part=expression,
                source_before=text,
                source_after=source_after,
            )


def _is_encodable(text: str, encoding: str) -> bool:
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        return False
    return True


def _rules_for(
    operators: _OperatorByName, expression: Expression, facts: StatementFacts
) -> Iterator[tuple[str, MutationRule]]:
    for name, operator in operators.items():
        if operator.rules:
            with OPERATOR_DOOR.blaming_package(name):
                for rule in operator.rules(expression, facts):
                    if not isinstance(rule, MutationRule):
                        raise TypeError(f"{rule!r} is no MutationRule")
                    yield name, rule


def _omission_mutations(
    file: ParsedFile, facts: StatementFacts, function: str, operators: _OperatorByName
) -> Iterator[Mutation]:
    every = ((f.def_line + 1, s) for f in file.functions_by_name.get(function, ()) for s in f.statements)
    anchorable = [
        (line, s)
        for line, s in every
        if s.unanchorable_reason is None and s.block_start_of_head_binding is None
    ]
    totals = Counter(
        (verb, name)
        for _, statement in anchorable
        for verb in ("assign", "call")
        for name in set(statement.names_for(verb))
    )
    numbers: Counter[tuple[str, str]] = Counter()
    for line, statement in anchorable:
        numbered_anchor = None
        for verb in ("assign", "call"):
            for name in statement.names_for(verb):
                numbers[verb, name] += 1
                numbered_anchor = numbered_anchor or (verb, name, numbers[verb, name])
        if numbered_anchor is None or not _can_be_omitted(statement, facts, line):
            continue
        omitting = [name for name, o in operators.items() if _operator_omits(name, o, statement, facts)]
        if not omitting:
            continue
        verb, name, number = numbered_anchor
        kind = AnchorKind.BEFORE_ASSIGN if verb == "assign" else AnchorKind.BEFORE_CALL
        anchor = Anchor(kind=kind, name=name, nth=number if totals[verb, name] > 1 else None)
        location = FaultLocation(path=file.path, function=function, anchor=anchor)
        try:
            file.resolve_statement(location)
        except MutatorError:
            continue  # LibCST and `ast` disagree on the place
        for operator in omitting:
            yield Mutation(
                operator=operator,
                location=location,
                model="omission",
                params=(),
                mutated_part=statement,
                source_before=facts.source_by_line.get(statement.first_line + 1, name),
                source_after=LEFT_OUT_TEXT,
            )


def _operator_omits(name: str, operator: Operator, statement: Statement, facts: StatementFacts) -> bool:
    with OPERATOR_DOOR.blaming_package(name):
        return bool(operator.omits and operator.omits(statement, facts))


def _can_be_omitted(statement: Statement, facts: StatementFacts, def_line: int) -> bool:
    """Return whether a statement can be omitted. The first binding of a local name cannot, because later
    uses of the name would fail.
    """
    if not statement.is_alone:
        return False
    names = [name for name in statement.assigned_names if name.isidentifier()]
    return all(
        facts.first_binding_line_by_name.get((def_line, name), 0) < statement.first_line + 1 for name in names
    )
