"""Counts activated, manifested and hazardous faults in the results table.

`texts` comes from `Results.texts`. Harness errors and invalid mutants are counted only as such.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from mutator.model import Outcome, Status
from mutator.results.column_facts import hazards_of
from mutator.results.rows import UNUSABLE, Count

if TYPE_CHECKING:
    import pandas as pd


def endings(texts: "pd.DataFrame") -> "pd.Series[str]":
    """Return the outcome of each row, or the status if the run failed."""
    worked = (texts["status"] == Status.OK.value) & (texts["outcome"] != "")
    return texts["outcome"].where(worked, texts["status"])


def outcome_counts(texts: "pd.DataFrame") -> dict[str, int]:
    seen = endings(texts).value_counts()
    order = [o.value for o in Outcome] + [s.value for s in Status if s is not Status.OK]
    return {name: int(seen[name]) for name in order if name in seen}


def hazard_names(texts: "pd.DataFrame") -> tuple[str, ...]:
    """Return the hazards that were checked, including those that never occurred."""
    return tuple(sorted(name for name in hazards_of(texts) if (texts[name.lower()] != "").any()))


def came(texts: "pd.DataFrame", hazard: str) -> "pd.Series[bool]":
    name = hazard.lower()
    return (texts[name] != "") & (texts[f"t_{name}"] != "")


def kinds(texts: "pd.DataFrame") -> "pd.Series[str]":
    """Return the fault type of each row: `sensor/bias`."""
    return texts["module"] + "/" + texts["fault_type"]


def counts_by(texts: "pd.DataFrame", groups: "pd.Series[str]") -> tuple[Count, ...]:
    """Return a count for each of the `groups`, sorted by name, then the total."""
    import pandas as pd

    hazards = hazard_names(texts)
    usable = ~texts["status"].isin([status.value for status in UNUSABLE])
    had = {name: came(texts, name) for name in hazards}
    any_hazard, alert = pd.DataFrame(had, index=texts.index).any(axis=1), texts["alerts"] != ""
    flags = {
        "injected": usable,
        "activated": texts["t_activation"] != "",
        "manifested": texts["t_manifest"] != "",
        **{f"hazard {name}": flag for name, flag in had.items()},
        "any_hazard": any_hazard,
        "alerts": alert,
        "hazards_without_alert": any_hazard & ~alert,
        "crashed": texts["status"] == Status.CRASHED.value,
        "timeout": texts["status"] == Status.TIMEOUT.value,
    }
    found = pd.DataFrame({name: flag & usable for name, flag in flags.items()} | {"unusable": ~usable})
    sums = found.groupby(groups.to_numpy(), sort=True).sum()
    lines = [(str(name), line) for name, line in sums.to_dict("index").items()]
    return tuple(_count(name, line, hazards) for name, line in (*lines, ("total", found.sum().to_dict())))


def _count(group: str, line: Mapping[Any, int], hazards: tuple[str, ...]) -> Count:
    plain = {name: int(number) for name, number in line.items() if not name.startswith("hazard ")}
    return Count(group=group, hazards=tuple(int(line[f"hazard {name}"]) for name in hazards), **plain)
