"""The hazards, alerts and channel ranges of a run folder's fault-free runs."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from mutator._common.table_rendering import TextTable
from mutator.outcomes.hazard_and_metric_judgement import judge_run
from mutator.outcomes.trace_and_record_loading import load_target_record, load_trace
from mutator.store.golden_runs import GoldenRun
from mutator.store.planned_scenarios import concrete_scenarios_of
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest

MOST_LISTED_OF_FAMILY = 10  # fault-free runs of a family in a table
MARGIN_PREFIX = "margin_"  # of the metrics that are margins of hazards
EventTimes = tuple[tuple[str, float], ...]  # (name, simulated time in s)


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultFreeRun:
    scenario: str
    scenario_label: str  # the scenario, or its family and values
    family: str  # the family that gave the scenario; '' for one of the library
    changes: tuple[str, ...]
    seed: int | None  # None: the seed of the run folder
    hazards: EventTimes
    alerts: EventTimes
    channel_ranges: tuple[
        tuple[str, float, float], ...
    ]  # name, minimum and maximum of recorded plotted channels
    metrics: tuple[tuple[str, float], ...]  # metrics of the manifest and margins of its hazards

    @property
    def margins(self) -> dict[str, float]:
        """The margins of hazards."""
        return {name: value for name, value in self.metrics if name.startswith(MARGIN_PREFIX)}


def load_fault_free_runs(folder: RunFolder, manifest: TargetManifest) -> tuple[FaultFreeRun, ...]:
    """Return the fault-free runs of a run folder, sorted by name. MutatorError if one cannot be read."""
    concrete_by_name = concrete_scenarios_of(folder.path)
    runs = []
    for golden_run in sorted(folder.goldens_with_files):
        run_folder = folder.golden_folder(*golden_run)
        concrete = concrete_by_name.get(golden_run.scenario)
        trace = load_trace(manifest, run_folder)
        judged = judge_run(manifest, trace, load_target_record(manifest, run_folder))
        plotted = [channel.name for channel in manifest.non_actuator_channels if channel.name in trace]
        runs.append(
            FaultFreeRun(
                **golden_run._asdict(),
                scenario_label=concrete.label_with_family if concrete else golden_run.scenario,
                family=concrete.family if concrete else "",
                hazards=judged.hazards,
                alerts=judged.alerts,
                channel_ranges=tuple((name, *_finite_range(trace[name])) for name in plotted),
                metrics=judged.metrics,
            )
        )
    return tuple(runs)


def latest_end_by_scenario(folder: RunFolder, manifest: TargetManifest) -> dict[str, float]:
    """Return the latest end of each scenario's golden runs, in simulated seconds. MutatorError if one cannot
    be read.
    """
    ends: dict[str, float] = {}
    for golden_run in folder.goldens_with_files:
        trace = load_trace(manifest, folder.golden_folder(*golden_run), [])
        end = float(trace[manifest.time_channel][-1])
        ends[golden_run.scenario] = max(end, ends.get(golden_run.scenario, end))
    return ends


def fault_free_table(runs: Sequence[FaultFreeRun], *, alerts: bool = True) -> TextTable:
    """Return the table of fault-free runs: first times of hazards and alerts, and channel ranges. Of each
    family, it has the worst runs.
    """
    channels = list(dict.fromkeys(name for run in runs for name, _, _ in run.channel_ranges))
    rows = []
    for run in _listed_runs(runs):
        ranges = {name: f"{least:.4g} to {largest:.4g}" for name, least, largest in run.channel_ranges}
        key = GoldenRun(run.scenario_label, run.changes, run.seed).key
        events = (
            [_describe_first_times(run.alerts), _describe_first_times(run.hazards)]
            if alerts
            else [_describe_first_times(run.hazards)]
        )
        rows.append([key, *events, *(ranges.get(name, "") for name in channels)])
    events = ["alerts", "hazards"] if alerts else ["hazards"]
    return TextTable(heads=["fault-free run", *events, *channels], rows=rows)


def _listed_runs(runs: Sequence[FaultFreeRun]) -> Iterator[FaultFreeRun]:
    """Yield the runs in scenarios of the library, then the worst of each family."""
    yield from (run for run in runs if not run.family)
    for family in sorted({run.family for run in runs if run.family}):
        yield from _worst_first([run for run in runs if run.family == family])[:MOST_LISTED_OF_FAMILY]


def _worst_first(runs: Sequence[FaultFreeRun]) -> list[FaultFreeRun]:
    """Sort runs by hazards, then by the smallest margin, as a multiple of its median, because margins have
    different units, then by alerts.
    """
    names = sorted({name for run in runs for name in run.margins})
    medians = {name: median(run.margins[name] for run in runs if name in run.margins) for name in names}

    def badness(run: FaultFreeRun) -> tuple[int, float, int]:
        shares = [value / medians[name] for name, value in run.margins.items() if medians[name] > 0]
        return (-len(run.hazards), min(shares, default=math.inf), -len(run.alerts))

    return sorted(runs, key=badness)


def unlisted_runs_note(runs: Iterable[FaultFreeRun]) -> str:
    """Return a sentence on the runs that `fault_free_table` leaves out; '' if none."""
    counts = Counter(run.family for run in runs if run.family)
    parts = [
        f"{family}: the {MOST_LISTED_OF_FAMILY} worst of {count}"
        for family, count in sorted(counts.items())
        if count > MOST_LISTED_OF_FAMILY
    ]
    return f"Of families, the table has the worst runs ({'; '.join(parts)})." if parts else ""


def fault_free_alerts_note(runs: Iterable[FaultFreeRun]) -> str:
    """Return a note on the alerts that fault-free runs raise, for tables that count alerts; '' if none."""
    scenarios: dict[str, dict[str, None]] = {}
    for run in runs:
        for name, _ in run.alerts:
            scenarios.setdefault(name, {})[run.family or run.scenario] = None
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
