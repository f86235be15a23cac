"""Typed rows of the results table, and the table of counts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mutator.model import Outcome, Status, fault_label
from mutator.results.column_facts import hazards_of
from mutator.targets.severity import DELTA_V

if TYPE_CHECKING:
    import pandas as pd

UNUSABLE = (Status.HARNESS_ERROR, Status.INVALID_MUTANT)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line of results.csv. Times are in simulated seconds; None: the event did not happen."""

    experiment_id: str
    module: str
    fault_type: str
    variant: str
    value: str
    unit: str
    scenario: str
    method: str
    trigger: str
    status: Status
    outcome: Outcome | None
    t_activation: float | None
    t_manifest: float | None
    checked: tuple[str, ...]  # hazards that the target checks
    hazards: tuple[tuple[str, float], ...]
    alerts: tuple[str, ...]
    t_alert: float | None
    reaction_time: float | None
    detail: str
    severity: str = ""  # class of the contact that ended the drive
    delta_v: float | None = None  # delta-v of that contact in m/s
    margins: tuple[tuple[str, float], ...] = ()  # by hazard: those that occurred or, if none did, all

    @property
    def margin(self) -> float | None:
        """The smallest margin, in the unit of its hazard."""
        return min((margin for _, margin in self.margins), default=None)

    @property
    def ending(self) -> str:
        """The outcome, or the status if the run failed."""
        return self.outcome.value if self.status is Status.OK and self.outcome else self.status.value

    @property
    def usable(self) -> bool:
        return self.status not in UNUSABLE

    @property
    def fault(self) -> str:
        return fault_label(f"{self.module}/{self.fault_type}/{self.variant}", self.value, self.unit)


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


def by_fault_type(row: Row) -> str:
    return f"{row.module}/{row.fault_type}"


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


def lines_of(texts: "pd.DataFrame") -> list[dict[str, str]]:
    names = list(map(str, texts.columns))
    columns = [texts[name].tolist() for name in names]
    return [dict(zip(names, cells, strict=True)) for cells in zip(*columns, strict=True)]


def rows_of(texts: "pd.DataFrame") -> list[Row]:
    hazards = hazards_of(texts)
    return [row_from(line, hazards) for line in lines_of(texts)]


def row_from(line: Mapping[str, str], hazards: Sequence[str]) -> Row:
    """Parse a line of results.csv, given by column, of a target with these hazards. KeyError or ValueError if
    it is invalid.
    """
    checked = [name for name in hazards if line[name.lower()]]
    times = {name: line[f"t_{name.lower()}"] for name in checked}
    came = [(name, float(time)) for name, time in times.items() if time]
    return Row(
        experiment_id=line["experiment_id"],
        module=line["module"],
        fault_type=line["fault_type"],
        variant=line["variant"],
        value=line["value"],
        unit=line["unit"],
        scenario=line["scenario"],
        method=line["method"],
        trigger=line["trigger"],
        status=Status(line["status"]),
        outcome=Outcome(line["outcome"]) if line["outcome"] else None,
        t_activation=_number(line["t_activation"]),
        t_manifest=_number(line["t_manifest"]),
        checked=tuple(checked),
        hazards=tuple(sorted(came, key=lambda h: h[1])),
        alerts=tuple(a for a in line["alerts"].split(";") if a),
        t_alert=_number(line["t_alert"]),
        reaction_time=_number(line["reaction_time"]),
        detail=line["detail"],
        severity=line.get("severity", ""),
        delta_v=_number(line.get(DELTA_V, "")),
        margins=_margins(line, [name for name, _ in came] or checked),
    )


def _margins(line: Mapping[str, str], hazards: Sequence[str]) -> tuple[tuple[str, float], ...]:
    texts = [(name, line.get(f"margin_{name.lower()}", "")) for name in hazards]
    return tuple((name, float(text)) for name, text in texts if text)


def _number(text: str) -> float | None:
    return float(text) if text else None
