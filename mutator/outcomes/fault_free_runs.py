"""The hazards, alerts and channel ranges of a run folder's fault-free runs."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from mutator._common.table_rendering import TextTable
from mutator.outcomes.hazard_and_metric_judgement import judge_run
from mutator.outcomes.trace_and_record_loading import load_target_record, load_trace
from mutator.store.golden_runs import GoldenRun
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest

EventTimes = tuple[tuple[str, float], ...]  # (name, simulated time in s)


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultFreeRun:
    scenario: str
    changes: tuple[str, ...]
    seed: int | None  # None: the seed of the run folder
    hazards: EventTimes
    alerts: EventTimes
    channel_ranges: tuple[
        tuple[str, float, float], ...
    ]  # name, minimum and maximum of recorded plotted channels


def load_fault_free_runs(folder: RunFolder, manifest: TargetManifest) -> tuple[FaultFreeRun, ...]:
    """Return the fault-free runs of a run folder, sorted by name. MutatorError if one cannot be read."""
    runs = []
    for golden_run in sorted(folder.kept_goldens):
        run_folder = folder.golden_folder(*golden_run)
        trace = load_trace(manifest, run_folder)
        judged = judge_run(manifest, trace, load_target_record(manifest, run_folder))
        plotted = [channel.name for channel in manifest.non_actuator_channels if channel.name in trace]
        runs.append(
            FaultFreeRun(
                **golden_run._asdict(),
                hazards=judged.hazards,
                alerts=judged.alerts,
                channel_ranges=tuple((name, *_finite_range(trace[name])) for name in plotted),
            )
        )
    return tuple(runs)


def fault_free_table(runs: Sequence[FaultFreeRun], *, alerts: bool = True) -> TextTable:
    """Return the table of fault-free runs: first times of hazards and alerts, and channel ranges."""
    channels = list(dict.fromkeys(name for run in runs for name, _, _ in run.channel_ranges))
    rows = []
    for run in runs:
        ranges = {name: f"{least:.4g} to {largest:.4g}" for name, least, largest in run.channel_ranges}
        key = GoldenRun(run.scenario, run.changes, run.seed).key
        events = (
            [_describe_first_times(run.alerts), _describe_first_times(run.hazards)]
            if alerts
            else [_describe_first_times(run.hazards)]
        )
        rows.append([key, *events, *(ranges.get(name, "") for name in channels)])
    events = ["alerts", "hazards"] if alerts else ["hazards"]
    return TextTable(heads=["fault-free run", *events, *channels], rows=rows)


def fault_free_alerts_note(runs: Iterable[FaultFreeRun]) -> str:
    """Return a note on the alerts that fault-free runs raise, for tables that count alerts; '' if none."""
    scenarios: dict[str, dict[str, None]] = {}
    for run in runs:
        for name, _ in run.alerts:
            scenarios.setdefault(name, {})[run.scenario] = None
    if not scenarios:
        return ""
    alert_texts = "; ".join(f"{name} in {', '.join(scenarios[name])}" for name in sorted(scenarios))
    return f"Not every alert is caused by a fault: fault-free runs raise {alert_texts}."


def alerts_by_scenario_and_seed(runs: Iterable[FaultFreeRun]) -> dict[tuple[str, str], frozenset[str]]:
    """Return the alerts that fault-free runs raise, by scenario and seed ('': the run folder's seed).

    Runs of a scenario with and without changes are combined.
    """
    names: dict[tuple[str, str], frozenset[str]] = {}
    for run in runs:
        key = (run.scenario, "" if run.seed is None else str(run.seed))
        names[key] = names.get(key, frozenset()) | {name for name, _ in run.alerts}
    return names


def _finite_range(values: np.ndarray) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if finite.size else (np.nan, np.nan)


def _describe_first_times(events: EventTimes) -> str:
    first: dict[str, float] = {}
    for name, t in events:
        first[name] = min(t, first.get(name, t))
    return ", ".join(f"{name} at {t:.2f} s" for name, t in first.items()) or "none"
