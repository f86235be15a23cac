"""Trials, read from their folders next to the runs, and the ranges of values that specs declare."""

import re
import threading
from pathlib import Path
from typing import Any

from mutator._common.confined_files import check_only_plain_files, read_below
from mutator.campaigns.phrase_collection import phrases_of_experiment
from mutator.campaigns.run_inputs import RunInputs
from mutator.config.units import UNITS
from mutator.errors import MutatorError, NotServed
from mutator.families.family import argument_of
from mutator.faults.fault_specs import FaultSpec, Variant
from mutator.model import Experiment, Status, Trigger
from mutator.outcomes.series_sampling import SeriesSampler
from mutator.outcomes.trace_and_record_loading import load_trace, trace_digest
from mutator.report.lone_experiment_data import ViewedTarget, experiment_view_data
from mutator.results.finished_experiments_and_columns import FinishedExperiment
from mutator.store.series_format import encode_series
from mutator.store.trial_file import StoredTrial
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import CONDITION_NAME, trigger_time_s
from mutator.workspace import Workspace

TRIALS_FOLDER = "try"  # folder of the results of `try`, next to the runs
_TRIAL_ID_PATTERN = re.compile(r"[0-9a-f]{16}")
_SLIDER_STEPS = 100  # for a range of real numbers without a step of its own


def trial_address(trial_id: str) -> str:
    return f"/trial/{trial_id}"


class ServedTrials:
    """The trials in a folder. Only one is read at a time, because each loads two traces."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self._lock = threading.Lock()

    def folder(self, trials: Path, trial_id: str) -> Path:
        """Return the folder of a trial; NotServed if there is none."""
        if not _TRIAL_ID_PATTERN.fullmatch(trial_id) or not (trials / trial_id).is_dir():
            raise NotServed(
                "no such trial", expected="a trial next to the runs", remedy="try the fault again"
            )
        return trials / trial_id

    def view_data(self, trials: Path, trial_id: str) -> dict[str, Any]:
        """Return the view of a trial, the request that repeats it, and the range of its value.

        NotServed if there is none; MutatorError if it is damaged, or if the target has changed since.
        """
        folder = self.folder(trials, trial_id)
        check_only_plain_files(folder)
        with self._lock:
            trial = StoredTrial.read(folder)
            if trial.experiment.id != trial_id:
                raise MutatorError(
                    f"the trial of {trial.experiment.id}", where=folder, remedy="try the fault again"
                )
            manifest = self._workspace.manifest(trial.target)
            self._check_unchanged(trial, manifest)
            view = self._view(folder, trial, manifest)
        request = _request_repeating(trial)
        return view | {"request": request, "range": self._range_of(trial.experiment)}

    def _check_unchanged(self, trial: StoredTrial, manifest: TargetManifest) -> None:
        inputs = RunInputs.of_experiments(self._workspace, manifest, [trial.experiment])
        current = inputs.digest_by_source()
        if changed := [name for name, digest in trial.sources.items() if current.get(name) != digest]:
            raise MutatorError(
                f"changed since this trial: {', '.join(changed)}",
                expected="the target, templates and scenario that it ran on",
                remedy="try the fault again",
            )

    def _view(self, folder: Path, trial: StoredTrial, manifest: TargetManifest) -> dict[str, Any]:
        scale = self._workspace.scale_of(manifest)
        phrases = phrases_of_experiment(self._workspace, manifest, trial.experiment)
        concrete = trial.experiment.concrete
        families = [self._workspace.family(concrete.family).facts] if concrete else []
        patch = read_below(folder, "mutant.patch") if (folder / "mutant.patch").is_file() else None
        return experiment_view_data(
            ViewedTarget.of_manifest(manifest, scale, phrases, families),
            FinishedExperiment(trial.experiment, trial.record, scale),
            patch,
            _encoded_series(folder, trial, manifest),
            "The run left no channels.",
        )

    def _range_of(self, experiment: Experiment) -> dict[str, Any] | None:
        spec_name, _, variant_name = experiment.fault.spec.rpartition("/")
        specs = [spec for spec in self._workspace.specs() if spec.name == spec_name]
        return next((range_as_json(v) for spec in specs for v in spec if v.name == variant_name), None)


def _encoded_series(folder: Path, trial: StoredTrial, manifest: TargetManifest) -> tuple[bytes, bytes] | None:
    """Return the encoded golden and faulty series; None if the run did not end normally."""
    if trial.record.status is not Status.OK:
        return None
    if trace_digest(manifest, folder / "faulty") != trial.record.trace_digest:
        raise MutatorError("the trace of another run", where=folder / "faulty", remedy="try the fault again")
    golden, faulty = load_trace(manifest, folder / "golden"), load_trace(manifest, folder / "faulty")
    sampler = SeriesSampler(manifest, golden)
    return sampler.encoded_golden, encode_series(sampler.faulty_series(faulty, trial.record), sampler.golden)


def _request_repeating(trial: StoredTrial) -> dict[str, Any]:
    """Return the request for a job that repeats a trial, as `job_requests.TrialRequest` reads it."""
    experiment, fault = trial.experiment, trial.experiment.fault
    spec, _, variant = fault.spec.rpartition("/")
    return {
        "kind": "try",
        "spec": spec,
        "variant": variant,
        "scenario": argument_of(experiment.concrete) if experiment.concrete else experiment.scenario,
        "trigger": _trigger_text(experiment.trigger),
        "value": fault.value if isinstance(fault.value, int | float) else None,
        "seed": experiment.seed,
        "reading": fault.reading,
        "target": trial.target,
    }


def _trigger_text(trigger: Trigger) -> str:
    """Return the text that `try` reads as this trigger: a time, a condition, or a name."""
    time_s = trigger_time_s(trigger)
    if time_s is not None:
        return repr(time_s)
    return trigger.condition if trigger.name == CONDITION_NAME else trigger.name


def range_as_json(variant: Variant) -> dict[str, Any] | None:
    """Return the range of values that a variant declares, with a step for a slider; None without a value, and
    for values in pairs, which cannot be chosen one by one.
    """
    draw = variant.draw
    if draw is None or variant.paired_draws:
        return None
    # sweeps add steps, which leaves 2.5000000000000004
    low, high = (float(f"{end:.12g}") for end in draw.least_and_greatest)
    is_whole = draw.kind == "integers" or all(float(value).is_integer() for value in draw.values or (0.5,))
    step = (
        1.0
        if is_whole
        else 10.0**-draw.decimals
        if draw.decimals is not None
        else (high - low) / _SLIDER_STEPS
    )
    return {"low": low, "high": high, "step": step, "unit": UNITS[draw.unit].symbol if draw.unit else ""}


def check_value_declared(spec: FaultSpec, variant_name: str | None, value: float) -> None:
    """Raise MutatorError for a value outside of the range that the spec declares for the variant (None: the
    first, which a trial takes).
    """
    variant = next(v for v in spec if variant_name in (None, v.name))
    value_range = range_as_json(variant)
    if value_range is None:
        raise MutatorError(f"the value {value:g}", where=f"{spec.name}/{variant.name}", expected="no value")
    if not value_range["low"] <= value <= value_range["high"]:
        raise MutatorError(
            f"the value {value:g}",
            where=f"{spec.name}/{variant.name}",
            expected=f"{value_range['low']:g} to {value_range['high']:g} {value_range['unit']}".rstrip()
            + ", the range that the spec declares",
            remedy="choose a value in the range, or run `mutator try` with --value",
        )
