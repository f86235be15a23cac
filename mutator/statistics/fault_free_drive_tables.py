"""Tables of golden runs by what they came to: hours, hazards, alerts and margins without any fault."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from mutator.model import ConcreteScenario
from mutator.statistics.statistics_sheet import Sheet, SheetCell
from mutator.store.golden_runs import GoldenRun
from mutator.store.golden_verdicts import GoldenVerdict, load_golden_verdicts
from mutator.store.planned_scenarios import concrete_scenarios_of
from mutator.store.run_folder import RunFolder

_SECONDS_PER_HOUR = 3600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedDrive:
    """A golden run with its verdict; `concrete` is its scenario, if a family gave it."""

    golden_run: GoldenRun
    concrete: ConcreteScenario | None
    verdict: GoldenVerdict

    @property
    def group(self) -> str:
        """The family, or the scenario that belongs to none."""
        return self.concrete.family if self.concrete else self.golden_run.scenario

    @property
    def label(self) -> str:
        return self.concrete.label if self.concrete else self.golden_run.scenario


def load_judged_drives(folder: RunFolder) -> tuple[JudgedDrive, ...]:
    """Return the golden runs with a stored verdict, in the order of the plan; none without families."""
    verdicts, concrete_by_name = load_golden_verdicts(folder), concrete_scenarios_of(folder.path)
    return tuple(
        JudgedDrive(golden_run=run, concrete=concrete_by_name.get(run.scenario), verdict=verdicts[run.key])
        for run in folder.golden_runs
        if run.key in verdicts
    )


def describe_drives(drives: Sequence[JudgedDrive]) -> str:
    """Return the totals in a sentence: drives, hours, and how many had each hazard and alert."""
    distinct = distinct_drives(drives)
    equal = len(drives) - len(distinct)
    return (
        f"{len(distinct):,} fault-free drives, {_hours(distinct):.2f} h; "
        + (f"{equal:,} more are equal, with other seeds; " if equal else "")
        + f"hazards: {_counted_names(_drives_by_name(d.verdict.hazards for d in distinct))}; "
        f"alerts: {_counted_names(_drives_by_name(d.verdict.alerts for d in distinct))}"
    )


def distinct_drives(drives: Iterable[JudgedDrive]) -> list[JudgedDrive]:
    """Return the drives without those that equal one of the same scenario with another seed."""
    first_by_trace: dict[GoldenRun | tuple[str, str], JudgedDrive] = {}
    for drive in drives:
        run, trace = drive.golden_run, drive.verdict.trace_digest
        first_by_trace.setdefault((run._replace(seed=None).key, trace) if trace else run, drive)
    return list(first_by_trace.values())


def _hours(drives: Iterable[JudgedDrive]) -> float:
    """Return the hours until a terminal hazard or the end."""
    return sum(drive.verdict.driven_s for drive in drives) / _SECONDS_PER_HOUR


def drives_by_group_sheet(
    drives: Sequence[JudgedDrive], hazards: Sequence[str], worse_direction: Mapping[str, str]
) -> Sheet:
    """Return a line for each family or scenario. `worse_direction` says of each metric shown whether its
    `lower` or `higher` values are worse; the worst value of all drives is shown.
    """
    lines: list[tuple[SheetCell, ...]] = []
    distinct = distinct_drives(drives)
    for group in dict.fromkeys(drive.group for drive in distinct):
        mine = [drive for drive in distinct if drive.group == group]
        with_hazard = _drives_by_name(drive.verdict.hazards for drive in mine)
        alerts = _drives_by_name(drive.verdict.alerts for drive in mine)
        lines.append(
            (
                group,
                len(mine),
                _hours(mine),
                *(with_hazard[name] for name in hazards),
                _counted_names(alerts),
                *(_worst(mine, name, direction) for name, direction in worse_direction.items()),
            )
        )
    return Sheet(
        name="fault_free_drives",
        title="Fault-free drives",
        note="Golden runs by family or scenario (equal ones of several seeds count once): hours until a "
        "terminal hazard or the end, drives with each hazard, drives with each alert, and the worst value of "
        "each metric.",
        heads=("scenario", "drives", "hours", *hazards, "alerts", *worse_direction),
        lines=tuple(lines),
    )


def each_drive_sheet(drives: Sequence[JudgedDrive], hazards: Sequence[str]) -> Sheet:
    """Return a line for each drive, with the values of its family's parameters."""
    keys = list(dict.fromkeys(key for drive in drives if drive.concrete for key in drive.concrete.values))
    metrics = list(dict.fromkeys(name for drive in drives for name, _ in drive.verdict.metrics))
    lines: list[tuple[SheetCell, ...]] = []
    for drive in drives:
        values = drive.concrete.values if drive.concrete else {}
        first_times, measured = dict(drive.verdict.hazards), dict(drive.verdict.metrics)
        lines.append(
            (
                drive.golden_run.key,
                drive.group,
                *(values.get(key) for key in keys),
                drive.verdict.driven_s,
                *(first_times.get(name) for name in hazards),
                ", ".join(dict.fromkeys(name for name, _ in drive.verdict.alerts)),
                *(measured.get(name) for name in metrics),
            )
        )
    return Sheet(
        name="each_fault_free_drive",
        title="Each fault-free drive",
        note="Times in s.",
        heads=(
            "golden_run",
            "scenario",
            *keys,
            "driven_s",
            *(f"t_{name.lower()}" for name in hazards),
            "alerts",
            *metrics,
        ),
        lines=tuple(lines),
    )


def _worst(drives: Sequence[JudgedDrive], metric: str, direction: str) -> float | None:
    values = [value for drive in drives for name, value in drive.verdict.metrics if name == metric]
    if not values:
        return None
    return min(values) if direction == "lower" else max(values)


def _drives_by_name(events_of_drives: Iterable[Sequence[tuple[str, float]]]) -> Counter[str]:
    """Return how many drives had each event."""
    return Counter(name for events in events_of_drives for name in dict.fromkeys(name for name, _ in events))


def _counted_names(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{name} in {count}" for name, count in sorted(counts.items())) or "none"
