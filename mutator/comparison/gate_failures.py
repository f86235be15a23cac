"""The experiments on which gates fail, each with all of its gates."""

from collections.abc import Sequence
from dataclasses import dataclass

from mutator.comparison.experiment_matching import ExperimentPair
from mutator.comparison.run_comparison_and_gates import Comparison, Gate, GateFinding
from mutator.model import Experiment

# what the gate of docs/how-to/gate-a-change-in-ci.md fails on
RECOMMENDED_GATES = (
    Gate.NEW_HAZARD,
    Gate.NEW_SILENT_HAZARD,
    Gate.OTHER_HAZARD,
    Gate.GOLDEN_HAZARD,
    Gate.NEW_CRASH,
    Gate.HARNESS_ERROR,
    Gate.UNMATCHED,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FailingExperiment:
    """An experiment on which at least one gate fails, and what a finding says about it.

    `experiment` is that of the second run, and `pair` None, if only one of the runs has it.
    """

    experiment: Experiment
    gates: tuple[Gate, ...]
    description: str
    sentence: str
    pair: ExperimentPair | None

    @property
    def gates_text(self) -> str:
        return ", ".join(gate.value for gate in self.gates)


def failing_experiments(
    comparison: Comparison, findings: Sequence[GateFinding]
) -> tuple[FailingExperiment, ...]:
    """Return the experiments of findings, each once, in the order of the findings."""
    gates_by_finding: dict[GateFinding, list[Gate]] = {}
    first_finding: dict[tuple[str, str], GateFinding] = {}
    for finding in findings:
        first = first_finding.setdefault((finding.experiment_id, finding.description), finding)
        gates_by_finding.setdefault(first, []).append(finding.gate)
    pair_by_id = {pair.b.id: pair for pair in comparison.pairs}
    planned = {e.id: e for e in (*comparison.a.experiments, *comparison.b.experiments)}
    return tuple(
        FailingExperiment(
            experiment=planned[finding.experiment_id],
            gates=tuple(gates),
            description=finding.description,
            sentence=finding.sentence,
            pair=None if Gate.UNMATCHED in gates else pair_by_id.get(finding.experiment_id),
        )
        for finding, gates in gates_by_finding.items()
    )


def worst_first(
    comparison: Comparison, failing: Sequence[FailingExperiment]
) -> tuple[FailingExperiment, ...]:
    """Return the experiments by their results in the second run, worst first; those without one come last."""
    ranks = comparison.b.rank_by_id
    return tuple(sorted(failing, key=lambda each: ranks.get(each.experiment.id, len(ranks))))
