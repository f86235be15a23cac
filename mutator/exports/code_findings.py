"""The hazards of a run as findings in the user's source, for code scanning and code quality tools."""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from mutator._common.message_text import counted
from mutator.campaigns.fault_positions import FaultPositions, SourcePosition
from mutator.comparison.run_comparison_and_gates import Gate, compare_runs, findings_of_gates
from mutator.errors import MutatorWarning
from mutator.exports import ExportRequest
from mutator.model import Experiment, Fault
from mutator.operators.operator_lookup import operator_name_of
from mutator.results.hazards_worst_first import hazardous_experiments
from mutator.results.result_rows import ResultRow
from mutator.store.run_folder import RunFolder

NEW_HAZARD_GATES = (Gate.NEW_HAZARD, Gate.NEW_SILENT_HAZARD, Gate.OTHER_HAZARD)


class Levels(NamedTuple):
    """A severity class in the words of SARIF and of GitLab."""

    sarif: str
    code_quality: str


LEVELS_BY_SEVERITY = {
    "S3": Levels("error", "blocker"),
    "S2": Levels("error", "critical"),
    "S1": Levels("warning", "major"),
    "S0": Levels("note", "minor"),
    "": Levels("warning", "major"),  # a hazard without a class
}


@dataclass(frozen=True, slots=True, kw_only=True)
class CodeFinding:
    """A hazard to which a fault led. `rule` is the operator or fault model; `positions` has the place of each
    injection, the first first.
    """

    experiment: Experiment
    row: ResultRow
    rule: str
    positions: tuple[SourcePosition, ...]

    @property
    def levels(self) -> Levels:
        return LEVELS_BY_SEVERITY[self.row.severity]

    @property
    def message(self) -> str:
        """What was injected, and what happened."""
        return f"{self.experiment.label}: {self.row.summary}"


def rule_name_of(fault: Fault) -> str:
    """Return the operator that made a fault, or the fault model of its first injection."""
    return operator_name_of(fault) or fault.injections[0].model


def hazard_findings(request: ExportRequest) -> list[CodeFinding]:
    """Return the hazards of a run, worst first; if a base is selected, only those that it does not have.

    Hazards in files outside of the user's repository are left out with a warning, because the tools cannot
    show them. MutatorError if the target has changed since the run.
    """
    assert request.workspace is not None
    folder, base = request.folder, request.selection.base
    positions = FaultPositions.of_run(folder, request.workspace)
    new_ids = None if base is None else new_hazard_ids(base, folder)
    findings = list(_findings_of_run(folder, positions))
    if new_ids is not None:
        findings = [finding for finding in findings if finding.experiment.id in new_ids]
    inside = [finding for finding in findings if finding.positions[0].is_in_repository]
    if outside := [finding for finding in findings if not finding.positions[0].is_in_repository]:
        warnings.warn(
            f"left out, because their files are in no repository: {counted(len(outside), 'hazard')} of "
            f"{len(findings)}, for example at {outside[0].positions[0]}; run the command in the folder of "
            "your repository",
            MutatorWarning,
            stacklevel=2,
        )
    return inside


def new_hazard_ids(base: Path, folder: RunFolder) -> frozenset[str]:
    """Return the experiments of a run with hazards that its base lacks, and those that only the run has."""
    comparison = compare_runs(base, folder.path)
    ids = {finding.experiment_id for finding in findings_of_gates(comparison, NEW_HAZARD_GATES)}
    return frozenset(ids | {experiment.id for experiment in comparison.matching.only_b})


def _findings_of_run(folder: RunFolder, positions: FaultPositions) -> Iterator[CodeFinding]:
    positions_by_fault: dict[str, tuple[SourcePosition, ...]] = {}
    for experiment, row in hazardous_experiments(folder):
        fault = experiment.fault
        if fault.id not in positions_by_fault:
            positions_by_fault[fault.id] = positions.of_fault(fault)
        yield CodeFinding(
            experiment=experiment,
            row=row,
            rule=rule_name_of(fault),
            positions=positions_by_fault[fault.id],
        )
