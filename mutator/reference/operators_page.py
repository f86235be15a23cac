"""Generate the page of mutation operators."""

from collections.abc import Iterator

from mutator._common.extension_doors import OPERATOR_DOOR
from mutator._common.table_rendering import TextTable
from mutator.operators.operator_lookup import find_operator
from mutator.reference.yaml_key_tables import generated_page_head
from mutator.workspace import Workspace

_INTRO = """\
A mutation operator makes faults without a spec: it changes one thing at a time in the functions of a
controller, imitating typical mistakes of programmers.
[Mutate without a spec](../how-to/mutate-without-a-spec.md) shows how to use operators, and
[Doors](doors.md#operator) how to add one. Each change is an ordinary fault, active while its trigger holds;
under the trigger `always`, from the start.
"""
_LEFT_OUT_NOTE = """\
Operators do not change strings and containers in arithmetic, the comparisons in a chain such as `a < b < c`,
expressions with a `yield`, or code outside functions. They do not leave out the assignment that gives a local
name its first value.

An exception raised by a changed expression is a crash of the controller: a result, not an invalid mutant.

## What is left out

* **Lines that the golden run does not execute.** One golden run for each scenario and seed finds the executed
  lines. Only those executed after the first observation are changed, so constructors are left out.
* **Equal code.** A mutant that compiles to the same code as the original or an earlier mutant is dropped.

Mutants left out for either reason are counted and reported. A sample draws from each operator in each
function in proportion to its number of mutants, so each mutant has the same chance.

## The faults
"""
_FIELDS_OF_OPERATOR_FAULTS = (
    ("spec", "`operators/<operator>/<path>::<function>`"),
    ("module, fault type", "`operators`, the operator"),
    (
        "value",
        "the change in the source: `a + b -> a - b`; tables show it in the column `variant`, after path and "
        "function",
    ),
    (
        "injection",
        "an anchor [`value`](fault-spec.md#a-place), or one before a statement, and one of the "
        "[fault models](fault-models.md) `operator_...` or `omission`",
    ),
)


def render_operators_page(workspace: Workspace) -> str:
    replacements = TextTable(heads=("operator", "where", "replacement"), rows=list(_replacement_rows()))
    fields = TextTable(heads=("field", "what it is"), rows=_FIELDS_OF_OPERATOR_FAULTS)
    tables = [table.as_markdown(escape=False) for table in (replacements, fields)]
    return (
        "\n".join(
            [generated_page_head("Mutation operators"), _INTRO, tables[0], "", _LEFT_OUT_NOTE, tables[1]]
        )
        + "\n"
    )


def _replacement_rows() -> Iterator[tuple[str, str, str]]:
    for name in OPERATOR_DOOR.shipped_names():
        heads = [f"`{name}`"]
        for where, replacement in find_operator(name).replacements:
            yield heads.pop() if heads else "", where, replacement
