"""Read another variable of the same kind: `cy` for `cx`."""

import ast
from collections.abc import Iterator

from mutator.mutants.changeable_expressions import Expression
from mutator.operators import MutationRule, Operator, mutation_rule
from mutator.operators.interchangeable_variables import replacements_of_name
from mutator.operators.statement_facts import StatementFacts, extent_of


def _rules(expression: Expression, facts: StatementFacts) -> Iterator[MutationRule]:
    node = expression.node
    if isinstance(node, ast.Name) and extent_of(node) not in facts.logged_name_extents:
        for name in replacements_of_name(facts.function_names, node, facts.types_at(node.lineno)):
            yield mutation_rule("operator_name", to=name)


OPERATOR = Operator(
    about="another variable of the same kind",
    replacements=(
        (
            "a local variable or parameter that is read, but not to log or print it",
            "the variables of the function that are of the same kind and bound there, at most the three that "
            "are nearest in spelling. With a golden run, the kind is the types that a variable has whenever "
            "the line runs. Without one, it is how the function assigns it (a number, a call of the same "
            "function, parts of one value), or a parameter's annotation or kind of default",
        ),
    ),
    rules=_rules,
    needs_types=True,
    is_in_all=False,
    examples={
        "return a": ["a -> b"],
        "cx, cy = a(b)\n    return cx": ["b -> a", "cx -> cy"],
        "c = 1.0\n    d = 2.0\n    e = 'x'\n    return d": ["d -> c"],
        "c = 1.0\n    d = 2.0\n    self.logger.info('%s', c)\n    log.error(f'{d}')\n    print(c)": [],
        "c = 1.0\n    d = 2.0\n    self.dialog.error(c)\n    logging.getLogger('a').info(d)\n    a.log(d)": [
            "c -> d",
            "d -> c",
        ],
        "if self: c = 1\n    d = 2\n    return d": [],
        "return [a for a in b]": [],
    },
)
