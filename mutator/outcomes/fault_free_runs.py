"""The hazards, alerts and channel ranges of a run folder's fault-free runs."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from mutator._common.table_rendering import TextTable
from mutator.outcomes.golden_comparison import load_record, load_trace
from mutator.outcomes.hazards_and_metrics import judge_run
from mutator.store.run_folder import GoldenRun, RunFolder
from mutator.targets.manifest import TargetManifest

Events = tuple[tuple[str, float], ...]  # (name, simulated time in s)


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultFreeRun:
    scenario: str
    changes: tuple[str, ...]
    seed: int | None  # None: the seed of the run folder
    hazards: Events
    alerts: Events
    ranges: tuple[tuple[str, float, float], ...]  # name, minimum and maximum of recorded plotted channels


def load_fault_free_runs(folder: RunFolder, manifest: TargetManifest) -> tuple[FaultFreeRun, ...]:
    """Return the fault-free runs of a run folder, sorted by name. MutatorError if one cannot be read."""
    found = []
    for one in sorted(folder.golden_runs):
        place = folder.golden_folder(*one)
        trace = load_trace(manifest, place)
        judged = judge_run(manifest, trace, load_record(manifest, place))
        plotted = [channel.name for channel in manifest.plotted if channel.name in trace]
        found.append(
            FaultFreeRun(
                **one._asdict(),
                hazards=judged.hazards,
                alerts=judged.alerts,
                ranges=tuple((name, *_range(trace[name])) for name in plotted),
            )
        )
    return tuple(found)


def fault_free_table(runs: Sequence[FaultFreeRun], *, alerts: bool = True) -> TextTable:
    """Return the table of fault-free runs: first times of hazards and alerts, and channel ranges."""
    channels = list(dict.fromkeys(name for run in runs for name, _, _ in run.ranges))
    rows = []
    for run in runs:
        ranges = {name: f"{least:.4g} to {largest:.4g}" for name, least, largest in run.ranges}
        key = GoldenRun(run.scenario, run.changes, run.seed).key
        events = [_told(run.alerts), _told(run.hazards)] if alerts else [_told(run.hazards)]
        rows.append([key, *events, *(ranges.get(name, "") for name in channels)])
    events = ["alerts", "hazards"] if alerts else ["hazards"]
    return TextTable(heads=["fault-free run", *events, *channels], rows=rows)


def own_alerts(runs: Iterable[FaultFreeRun]) -> str:
    """Return a note on the alerts that fault-free runs raise, for tables that count alerts; '' if none."""
    scenarios: dict[str, dict[str, None]] = {}
    for run in runs:
        for name, _ in run.alerts:
            scenarios.setdefault(name, {})[run.scenario] = None
    if not scenarios:
        return ""
    told = "; ".join(f"{name} in {', '.join(scenarios[name])}" for name in sorted(scenarios))
    return f"Not every alert is caused by a fault: fault-free runs raise {told}."


def alerts_by_drive(runs: Iterable[FaultFreeRun]) -> dict[tuple[str, str], frozenset[str]]:
    """Return the alerts that fault-free runs raise, by scenario and seed ('': the run folder's seed).

    Runs of a scenario with and without changes are combined.
    """
    names: dict[tuple[str, str], frozenset[str]] = {}
    for run in runs:
        key = (run.scenario, "" if run.seed is None else str(run.seed))
        names[key] = names.get(key, frozenset()) | {name for name, _ in run.alerts}
    return names


def _range(values: np.ndarray) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    return (float(known.min()), float(known.max())) if known.size else (np.nan, np.nan)


def _told(events: Events) -> str:
    first: dict[str, float] = {}
    for name, t in events:
        first[name] = min(t, first.get(name, t))
    return ", ".join(f"{name} at {t:.2f} s" for name, t in first.items()) or "none"
