"""Leave out a statement."""

from mutator.mutants.function_statements import Statement
from mutator.operators import Operator
from mutator.operators.statement_facts import StatementFacts


def _omits(statement: Statement, facts: StatementFacts) -> bool:
    return not statement.is_return


OPERATOR = Operator(
    about="a statement that is left out",
    replacements=(("an assignment, an augmented assignment or a call, alone on its lines", "left out"),),
    omits=_omits,
    examples={
        "a = b": ["a = b -> left out"],
        "self.a = b": ["self.a = b -> left out"],
        "a += b": ["a += b -> left out"],
        "a(b)": ["a(b) -> left out"],
        "c = b": [],  # the first value of `c`, without which the name would not exist
        "c: int\n    c = b": [],  # an annotation alone is no value
        "if a: b = c": [],
        "a([c for c in b])\n    c = b": ["a([c for c in b]) -> left out"],  # the `c` inside is another one
    },
)
