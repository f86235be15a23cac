"""Records of experiments that have a status but no outcome."""

from dataclasses import replace

from mutator._common.hashing import digest
from mutator.model import Experiment, ObservedActivation, Record, Status
from mutator.mutants.mutant_building import Mutant


def record_of_mutant_without_outcome(
    experiment: Experiment,
    status: Status,
    detail: str,
    mutant: Mutant | None,
    activation: ObservedActivation | None = None,
) -> Record:
    bare = record_without_outcome(experiment.id, status, detail)
    if mutant is not None:
        bare = replace(bare, tree=mutant.tree_digest, patch=digest(mutant.patch_bytes))
    return replace(bare, activation=activation)


def record_without_outcome(experiment_id: str, status: Status, detail: str) -> Record:
    """Make the record of an experiment that has a status but no outcome."""
    return Record(
        experiment_id=experiment_id,
        status=status,
        outcome=None,
        detail=detail,
        tree="",
        activation=None,
        t_manifest=None,
        max_dev=(),
        hazards=(),
        alerts=(),
        trace_digest="",
    )
