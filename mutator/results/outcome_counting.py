"""Counts activated, manifested and hazardous faults in the results table.

`frame` comes from `Results.frame`. Harness errors and invalid mutants are counted only as such.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import compress
from typing import TYPE_CHECKING, Any

from mutator.model import Outcome, Status
from mutator.results.table_columns import hazards_of

if TYPE_CHECKING:
    import pandas as pd

UNUSABLE = (Status.HARNESS_ERROR, Status.INVALID_MUTANT)


@dataclass(frozen=True, slots=True, kw_only=True)
class Count:
    """Counts over the usable experiments of one group. `unusable` counts the other experiments."""

    group: str
    injected: int
    activated: int
    manifested: int
    hazards: tuple[int, ...]  # one number for each hazard in the results
    any_hazard: int
    alerts: int
    hazards_without_alert: int
    crashed: int
    timeout: int
    unusable: int


def endings(frame: "pd.DataFrame") -> "pd.Series[str]":
    """Return the outcome of each row, or the status if the run failed."""
    worked = (frame["status"] == Status.OK.value) & (frame["outcome"] != "")
    return frame["outcome"].where(worked, frame["status"])


def outcome_counts(frame: "pd.DataFrame") -> dict[str, int]:
    seen = endings(frame).value_counts()
    order = [o.value for o in Outcome] + [s.value for s in Status if s is not Status.OK]
    return {name: int(seen[name]) for name in order if name in seen}


def hazard_names(frame: "pd.DataFrame") -> tuple[str, ...]:
    """Return the hazards that were checked, including those that never occurred."""
    return tuple(sorted(name for name in hazards_of(frame) if frame[name.lower()].notna().any()))


def hazard_times(frame: "pd.DataFrame") -> "pd.DataFrame":
    """Return the first time of each hazard, a column for each. NaN if it did not occur or the run failed."""
    import pandas as pd

    columns = {name: (frame[f"t_{name.lower()}"], frame[name.lower()].notna()) for name in hazards_of(frame)}
    times = {name: time.where(is_checked) for name, (time, is_checked) in columns.items()}
    return pd.DataFrame(times, index=frame.index, dtype=float)


def hazard_margins(frame: "pd.DataFrame") -> "pd.DataFrame":
    """Return the margins to the hazards that occurred or, if none did, to all that were checked. There is a
    column for each hazard with a margin; NaN: no value.
    """
    import pandas as pd

    had = hazard_times(frame).notna()
    had_none = ~had.any(axis=1)
    margins = {}
    for name in hazards_of(frame):
        if (column := f"margin_{name.lower()}") in frame:
            margins[name] = frame[column].where(had[name] | had_none & frame[name.lower()].notna())
    return pd.DataFrame(margins, index=frame.index, dtype=float)


def hazards_joined(frame: "pd.DataFrame") -> list[str]:
    """Return the names of the hazards that occurred in each row, sorted and joined by `;`."""
    had = hazard_times(frame).notna()
    names = sorted(hazards_of(frame))
    return [";".join(compress(names, row)) for row in had[names].to_numpy()]


def kinds(frame: "pd.DataFrame") -> "pd.Series[str]":
    """Return the fault type of each row: `sensor/bias`."""
    return frame["module"] + "/" + frame["fault_type"]


def counts_by(frame: "pd.DataFrame", groups: "pd.Series[str]") -> tuple[Count, ...]:
    """Return a count for each of the `groups`, sorted by name, then the total."""
    import pandas as pd

    hazards = hazard_names(frame)
    usable = ~frame["status"].isin([status.value for status in UNUSABLE])
    had = hazard_times(frame).notna()
    any_hazard, alert = had.any(axis=1), frame["alerts"] != ""
    flags = {
        "injected": usable,
        "activated": frame["t_activation"].notna(),
        "manifested": frame["t_manifest"].notna(),
        **{f"hazard {name}": had[name] for name in hazards},
        "any_hazard": any_hazard,
        "alerts": alert,
        "hazards_without_alert": any_hazard & ~alert,
        "crashed": frame["status"] == Status.CRASHED.value,
        "timeout": frame["status"] == Status.TIMEOUT.value,
    }
    found = pd.DataFrame({name: flag & usable for name, flag in flags.items()} | {"unusable": ~usable})
    sums = found.groupby(groups.to_numpy(), sort=True).sum()
    lines = [(str(name), line) for name, line in sums.to_dict("index").items()]
    return tuple(_count(name, line, hazards) for name, line in (*lines, ("total", found.sum().to_dict())))


def _count(group: str, line: Mapping[Any, int], hazards: tuple[str, ...]) -> Count:
    plain = {name: int(number) for name, number in line.items() if not name.startswith("hazard ")}
    return Count(group=group, hazards=tuple(int(line[f"hazard {name}"]) for name in hazards), **plain)


def count_table(
    counts: Sequence[Count], head: str, hazards: Sequence[str], *, alerts: bool = True
) -> tuple[list[str], list[list[str]]]:
    """Return a table of counts. It has columns for crashes, timeouts and unusable runs only if any exist."""
    heads = [head, "injected", "activated", "manifested", *hazards]
    heads += ["any hazard", "alerts", "hazard, no alert"] if alerts else ["any hazard"]
    table = [[c.group, c.injected, c.activated, c.manifested, *c.hazards, c.any_hazard] for c in counts]
    for line, c in zip(table, counts, strict=True):
        line += [c.alerts, c.hazards_without_alert] if alerts else []
    for name in ("crashed", "timeout", "unusable"):
        column = [getattr(c, name) for c in counts]
        if any(column):
            heads.append(name)
            for line, number in zip(table, column, strict=True):
                line.append(number)
    return heads, [[str(cell) for cell in line] for line in table]
