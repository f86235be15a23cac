"""Mutants from mutation operators, which need no spec."""

from collections.abc import Sequence
from dataclasses import dataclass

from mutator._common.argument_checks import check_whole_number
from mutator._common.message_text import counted
from mutator.api.target_and_fault_selection import SelectedTarget
from mutator.engines.run_limits import limits_before_measuring
from mutator.errors import MutatorError
from mutator.limits import Limits
from mutator.model import Fault
from mutator.operators.executed_lines_and_types import (
    GoldenRunInputs,
    measure_executed_lines,
    measure_variable_types,
)
from mutator.operators.mutation_selection import sample_mutations, select_mutations
from mutator.operators.operator_lookup import any_needs_types, unique_operator_names


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorChoice:
    """A choice of mutants of mutation operators.

    In each function, each operator is sampled in proportion to its mutants.
    """

    operators: Sequence[str]  #: names of mutation operators, or `all`
    #: `PATH::FUNCTION` or `PATH`; `*` is a wildcard, and `**` also matches across folders
    places: Sequence[str]
    #: only lines that the golden run of this scenario executes; None: all lines
    scenario: str | None = None
    sample: int | None = None  #: number of mutants to draw; None: all
    seed: int = 0  #: seed of the draw and of the golden run


def draw_operator_faults(
    selected_target: SelectedTarget, choice: OperatorChoice
) -> tuple[tuple[Fault, ...], str]:
    """Return the faults in the order of files and lines, and a text that counts them and those left out.

    MutatorError for an unknown operator or place, and if no mutant is left.
    """
    check_whole_number("seed", choice.seed)
    if choice.sample is not None:
        check_whole_number("sample", choice.sample, least=1)
    executed = types = None
    operators = unique_operator_names(choice.operators)
    if choice.scenario is not None:
        scenario = selected_target.workspace.scenario(choice.scenario)
        limits = limits_before_measuring(Limits())
        drive = GoldenRunInputs(scenario=scenario, changes=(), seed=choice.seed)
        [executed] = measure_executed_lines(selected_target.manifest, [drive], limits)
        if any_needs_types(operators):
            types = measure_variable_types(selected_target.manifest, [drive], limits)
    candidates = select_mutations(
        selected_target.manifest, selected_target.models, operators, choice.places, executed, types
    )
    if not candidates.mutations:
        raise MutatorError(
            f"no mutant in {', '.join(choice.places)} ({candidates.summary})",
            argument="in",
            remedy="choose other places or operators, or include lines that are not executed",
        )
    sample = sample_mutations(candidates, choice.sample, choice.seed)
    note = (
        candidates.summary
        if len(sample) == len(candidates.mutations)
        else f"{counted(len(sample), 'draw')} of {candidates.summary}"
    )
    reading = selected_target.workspace.readings().default_name
    return tuple(mutation.to_fault(reading) for mutation in sample), note
