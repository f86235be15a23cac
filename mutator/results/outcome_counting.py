"""Counts activated, manifested and hazardous faults in the results table.

`frame` comes from `Results.frame`. Endings that say nothing about a fault (`UNUSABLE_ENDINGS`) are
counted only as such.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import compress
from typing import TYPE_CHECKING, Any

from mutator.model import Outcome, Status
from mutator.results.table_columns import hazard_names_of_frame

if TYPE_CHECKING:
    import pandas as pd

# outcomes and statuses of experiments that say nothing about their fault
UNUSABLE_ENDINGS = (Status.HARNESS_ERROR, Status.INVALID_MUTANT, Status.LEFT_OUT, Outcome.NOT_JUDGED)


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupCount:
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


def are_usable(frame: "pd.DataFrame") -> "pd.Series[bool]":
    """Whether each row says something about its fault."""
    unusable = [ending.value for ending in UNUSABLE_ENDINGS]
    columns = [name for name in ("status", "outcome") if name in frame]
    return ~frame[columns].isin(unusable).any(axis=1)


def outcome_or_status_of_rows(frame: "pd.DataFrame") -> "pd.Series[str]":
    """Return the outcome of each row, or the status if the run failed."""
    worked = (frame["status"] == Status.OK.value) & (frame["outcome"] != "")
    return frame["outcome"].where(worked, frame["status"])


def count_by_outcome_or_status(frame: "pd.DataFrame") -> dict[str, int]:
    count_by_ending = outcome_or_status_of_rows(frame).value_counts()
    order = [o.value for o in Outcome] + [s.value for s in Status if s is not Status.OK]
    return {name: int(count_by_ending[name]) for name in order if name in count_by_ending}


def checked_hazard_names(frame: "pd.DataFrame") -> tuple[str, ...]:
    """Return the hazards that were checked, including those that never occurred."""
    return tuple(sorted(name for name in hazard_names_of_frame(frame) if frame[name.lower()].notna().any()))


def first_hazard_times(frame: "pd.DataFrame") -> "pd.DataFrame":
    """Return the first time of each hazard, a column for each. NaN if it did not occur or the run failed."""
    import pandas as pd

    columns = {
        name: (frame[f"t_{name.lower()}"], frame[name.lower()].notna())
        for name in hazard_names_of_frame(frame)
    }
    times = {name: time.where(is_checked) for name, (time, is_checked) in columns.items()}
    return pd.DataFrame(times, index=frame.index, dtype=float)


def hazard_margins(frame: "pd.DataFrame") -> "pd.DataFrame":
    """Return the margins to the hazards that occurred or, if none did, to all that were checked. There is a
    column for each hazard with a margin; NaN: no value.
    """
    import pandas as pd

    occurred = first_hazard_times(frame).notna()
    none_occurred = ~occurred.any(axis=1)
    margins = {}
    for name in hazard_names_of_frame(frame):
        if (column := f"margin_{name.lower()}") in frame:
            margins[name] = frame[column].where(occurred[name] | none_occurred & frame[name.lower()].notna())
    return pd.DataFrame(margins, index=frame.index, dtype=float)


def joined_occurred_hazards(frame: "pd.DataFrame") -> list[str]:
    """Return the names of the hazards that occurred in each row, sorted and joined by `;`."""
    occurred = first_hazard_times(frame).notna()
    names = sorted(hazard_names_of_frame(frame))
    return [";".join(compress(names, row)) for row in occurred[names].to_numpy()]


def fault_types_of(frame: "pd.DataFrame") -> "pd.Series[str]":
    """Return the fault type of each row: `sensor/bias`."""
    return frame["module"] + "/" + frame["fault_type"]


def families_or_scenarios_of(frame: "pd.DataFrame") -> "pd.Series[str]":
    """Return the family that gave the scenario of each row, or the scenario of the library."""
    if "family" not in frame:
        return frame["scenario"]
    return frame["family"].where(frame["family"] != "", frame["scenario"])


def count_outcomes_by_group(frame: "pd.DataFrame", groups: "pd.Series[str]") -> tuple[GroupCount, ...]:
    """Return a count for each of the `groups`, sorted by name, then the total."""
    import pandas as pd

    hazards = checked_hazard_names(frame)
    usable = are_usable(frame)
    occurred = first_hazard_times(frame).notna()
    any_hazard, alert = occurred.any(axis=1), frame["alerts"] != ""
    flags = {
        "injected": usable,
        "activated": frame["t_activation"].notna(),
        "manifested": frame["t_manifest"].notna(),
        **{f"hazard {name}": occurred[name] for name in hazards},
        "any_hazard": any_hazard,
        "alerts": alert,
        "hazards_without_alert": any_hazard & ~alert,
        "crashed": frame["status"] == Status.CRASHED.value,
        "timeout": frame["status"] == Status.TIMEOUT.value,
    }
    flags_by_column = pd.DataFrame(
        {name: flag & usable for name, flag in flags.items()} | {"unusable": ~usable}
    )
    sums = flags_by_column.groupby(groups.to_numpy(), sort=True).sum()
    lines = [(str(name), line) for name, line in sums.to_dict("index").items()]
    return tuple(
        _group_count(name, line, hazards)
        for name, line in (*lines, ("total", flags_by_column.sum().to_dict()))
    )


def _group_count(group: str, line: Mapping[Any, int], hazards: tuple[str, ...]) -> GroupCount:
    plain = {name: int(number) for name, number in line.items() if not name.startswith("hazard ")}
    return GroupCount(group=group, hazards=tuple(int(line[f"hazard {name}"]) for name in hazards), **plain)


def count_table(
    counts: Sequence[GroupCount], head: str, hazards: Sequence[str], *, alerts: bool = True
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
