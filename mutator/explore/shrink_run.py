"""Drives the forms of a fault on a bench."""

from collections.abc import Callable, Mapping

import numpy as np

from mutator.campaigns.exploration_section import ExploredPlane
from mutator.errors import MutatorError
from mutator.execution.bench import Bench
from mutator.explore.exploration_run import check_harness
from mutator.explore.fault_forms import FaultForm, FormResult
from mutator.explore.golden_drives import drive_of, load_observed_values
from mutator.explore.shrinking import Shrinking
from mutator.model import Experiment, Outcome, Record
from mutator.store.golden_runs import GoldenRun
from mutator.targets.manifest import TargetManifest

BuildForm = Callable[[FaultForm], Experiment]


def golden_values_of(
    bench: Bench, manifest: TargetManifest, experiment: Experiment
) -> Mapping[str, np.ndarray]:
    """Return what the experiment's golden run recorded of the values that conditions name, for each step.

    CheckFailed if the golden run fails its checks.
    """
    golden = GoldenRun.for_experiment(experiment, several_seeds=True)
    return load_observed_values(manifest, bench.checked_golden_folders([experiment])[golden])


def trigger_start_s(
    manifest: TargetManifest, golden: Mapping[str, np.ndarray], experiment: Experiment
) -> float | None:
    """Return when the experiment's trigger fires in its golden run.

    None if it never does, or if the golden run does not record what its condition names.
    """
    trigger = experiment.trigger
    plane = ExploredPlane(
        spec=experiment.fault.spec,
        scenario=experiment.scenario,
        start=trigger.name,
        condition=trigger.condition,
        armed_after_s=trigger.armed_after_s,
        magnitudes=[],
        durations_s=[manifest.step_s],
    )
    try:
        return drive_of(manifest, golden, plane).start_s
    except MutatorError:
        return None


def run_shrinking(bench: Bench, shrinking: Shrinking, hazard: str, build: BuildForm) -> None:
    """Run a search to its end, or go on with it.

    MutatorError if the harness failed in an experiment.
    """
    proposals = shrinking.proposals()
    batch, number = next(proposals, None), 0
    while batch is not None:
        number += 1
        records = bench.run([build(form) for form in batch], f"shrinking, batch {number}")
        for record in records:
            check_harness(record)
        results = {form: _result_of(record, hazard) for form, record in zip(batch, records, strict=True)}
        try:
            batch = proposals.send(results)
        except StopIteration:
            batch = None


def _result_of(record: Record, hazard: str) -> FormResult:
    time_by_hazard = dict(record.hazards) if record.outcome is Outcome.HAZARD else {}
    return FormResult(
        experiment_id=record.experiment_id,
        hazard_s=time_by_hazard.get(hazard),
        ending=str(record.outcome or record.status),
    )
