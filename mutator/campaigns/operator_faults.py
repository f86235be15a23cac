"""The faults that a campaign takes from mutation operators, with their scenarios and activation."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from mutator._common.hashing import digest
from mutator._common.message_text import counted
from mutator.campaigns.operator_selection import MutantActivity, OperatorSelection
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModels
from mutator.limits import Limits
from mutator.model import Fault
from mutator.operators.executed_lines_and_types import (
    ExecutedLinesByFile,
    GoldenRunInputs,
    TypesByFileAndLine,
    measure_executed_lines,
    measure_variable_types,
)
from mutator.operators.mutation_selection import SelectedMutations, sample_mutations, select_mutations
from mutator.operators.operator_lookup import any_needs_types
from mutator.operators.statement_facts import statement_facts_of
from mutator.targets.manifest import TargetManifest


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorFault:
    """A fault created by an operator, and the scenarios whose golden runs execute the changed line."""

    fault: Fault
    activities: tuple[MutantActivity, ...]
    executing_scenarios: frozenset[str]


class OperatorFaultFinder:
    """Creates the operator faults of selections. Mutants enumerated for one seed are reused for others."""

    def __init__(self, manifest: TargetManifest, models: FaultModels, limits: Limits) -> None:
        self._manifest, self._models, self._limits = manifest, models, limits
        self._mutations_by_selection: dict[
            tuple[OperatorSelection, frozenset[tuple[str, frozenset[int]]], str], SelectedMutations
        ] = {}
        self.notes: dict[str, None] = {}  # lines that say what was found and left out, without duplicates

    def faults_of_selection(
        self,
        selection: OperatorSelection,
        golden_inputs_by_scenario: Mapping[str, GoldenRunInputs],
        seed: int,
        reading: str,
    ) -> list[OperatorFault]:
        golden_runs = list(golden_inputs_by_scenario.values())
        types = None
        if any_needs_types(selection.operators):  # first, because these runs note the lines, too
            types = measure_variable_types(self._manifest, golden_runs, self._limits)
        lines_by_run = measure_executed_lines(self._manifest, golden_runs, self._limits)
        executed = dict(zip(golden_inputs_by_scenario, lines_by_run, strict=True))
        mutations = self._find_mutations(selection, list(executed.values()), types)
        draw = sample_mutations(mutations, selection.sample_size, seed)
        if not draw:
            raise MutatorError(
                f"no mutant in {', '.join(selection.places)} ({mutations.summary})",
                expected="places with lines that a scenario of the campaign executes",
                remedy="name other places, operators or scenarios",
            )
        paths = {mutation.location.path for mutation in draw}
        executed_statements = {
            name: {path: self._lines_of_executed_statements(path, lines.get(path, ())) for path in paths}
            for name, lines in executed.items()
        }
        draws = f"{counted(len(draw), 'draw')} of " if len(draw) < len(mutations.mutations) else ""
        self.notes[f"{', '.join(selection.places)}: {draws}{mutations.summary}"] = None
        return [
            OperatorFault(
                fault=mutation.to_fault(reading),
                activities=selection.activities,
                executing_scenarios=frozenset(
                    name
                    for name, lines_by_path in executed_statements.items()
                    # mutations count lines from 0, measured lines begin at 1
                    if mutation.line + 1 in lines_by_path[mutation.location.path]
                ),
            )
            for mutation in draw
        ]

    def _find_mutations(
        self,
        selection: OperatorSelection,
        executed: Sequence[ExecutedLinesByFile],
        types: TypesByFileAndLine | None,
    ) -> SelectedMutations:
        files = dict.fromkeys(path for lines in executed for path in lines)
        union = {path: frozenset().union(*(lines.get(path, ()) for lines in executed)) for path in files}
        # types follow from the golden runs, and so do the lines; seeds can differ in types alone
        key = (selection, frozenset(union.items()), digest(types))
        if key not in self._mutations_by_selection:
            self._mutations_by_selection[key] = select_mutations(
                self._manifest, self._models, selection.operators, selection.places, union, types
            )
        return self._mutations_by_selection[key]

    def _lines_of_executed_statements(self, path: str, lines: Collection[int]) -> frozenset[int]:
        return statement_facts_of(self._manifest.tree, path).extend_to_statements(lines)
