"""The counts of one group of experiments, from a run or a publication."""

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from mutator.results.outcome_counting import families_or_scenarios_of

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """Numbers of a group's faults that were injected, activated and so on. None: not known.

    Only alerts and hazards at or after the activation are counted. `hazards_no_alerts` counts hazards in runs
    without any alert.
    """

    injected: int
    activated: int
    hazards: int
    manifested: int | None = None
    alerts: int | None = None
    hazards_no_alerts: int | None = None
    alerts_no_hazards: int | None = None


def tally_of_runs(frame: "pd.DataFrame") -> Tally:
    hazard, alert = frame["is_hazard"], frame["is_alert"]
    return Tally(
        injected=len(frame),
        activated=int(frame["is_activated"].sum()),
        manifested=int(frame["is_manifested"].sum()),
        hazards=int(hazard.sum()),
        alerts=int(alert.sum()),
        hazards_no_alerts=int((hazard & ~alert).sum()),
        alerts_no_hazards=int((alert & ~hazard).sum()),
    )


def flag_of_count(frame: "pd.DataFrame", name: str) -> "pd.Series":
    """Return which rows a count of `Tally` counts."""
    if name == "injected":
        return frame["is_activated"] | True
    if name == "hazards_no_alerts":
        return frame["is_hazard"] & ~frame["is_alert"]
    if name == "alerts_no_hazards":
        return frame["is_alert"] & ~frame["is_hazard"]
    return frame[f"is_{name.removesuffix('s')}"]


def sum_tallies(tallies: Iterable[Tally]) -> Tally:
    """Return the sum over groups. A count is None if it is None in any group."""
    summands = list(tallies)
    sums: dict[str, Any] = {}
    for field in fields(Tally):
        counts = [getattr(tally, field.name) for tally in summands]
        sums[field.name] = None if None in counts else sum(counts)
    return Tally(**sums)


def tally_by_scenario(frame: "pd.DataFrame") -> dict[tuple[str, str], Tally]:
    """Return the counts by method and scenario; those of a family count as one."""
    return {
        (str(m), str(s)): tally_of_runs(group)
        for (m, s), group in frame.groupby(["method", families_or_scenarios_of(frame)])
    }


def tally_by_fault_type(frame: "pd.DataFrame") -> dict[tuple[str, str], Tally]:
    return {(str(m), str(k)): tally_of_runs(group) for (m, k), group in frame.groupby(["method", "kind"])}
