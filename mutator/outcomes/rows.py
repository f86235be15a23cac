"""Rows of the results table, typed, and counted: how many faults were activated, manifested, did harm.

A row stands for one experiment. An experiment whose harness failed, or whose mutant could not be made,
says nothing about its fault: it is counted apart and is in no other number.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from mutator.model import Outcome, Status, fault_label
from mutator.outcomes.columns import hazards_in
from mutator.targets.severity import DELTA_V

UNUSABLE = (Status.HARNESS_ERROR, Status.INVALID_MUTANT)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line of results.csv, typed. Times are s of simulation, None: did not happen."""

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
    checked: tuple[str, ...]  # the hazards that the target looked for
    hazards: tuple[tuple[str, float], ...]
    alerts: tuple[str, ...]
    t_alert: float | None
    reaction_time: float | None
    detail: str
    severity: str = ""  # class of the contact that ended the drive
    delta_v: float | None = None  # m/s, in it
    margins: tuple[tuple[str, float], ...] = ()  # to the hazards that came, else to all

    @property
    def margin(self) -> float | None:
        """The least margin, as a number in whatever unit its hazard has it."""
        return min((margin for _, margin in self.margins), default=None)

    @property
    def ending(self) -> str:
        """The outcome of a run that worked, the status of one that did not."""
        return self.outcome.value if self.status is Status.OK and self.outcome else self.status.value

    @property
    def usable(self) -> bool:
        return self.status not in UNUSABLE

    @property
    def fault(self) -> str:
        """The label of the fault."""
        return fault_label(f"{self.module}/{self.fault_type}/{self.variant}", self.value, self.unit)


@dataclass(frozen=True, slots=True, kw_only=True)
class Count:
    """What became of the usable experiments of one group; `unusable` were none."""

    group: str
    injected: int
    activated: int
    manifested: int
    hazards: tuple[int, ...]  # one number for each hazard named in the results
    any_hazard: int
    alerts: int
    hazards_without_alert: int
    crashed: int
    timeout: int
    unusable: int


def hazard_names(rows: Iterable[Row]) -> tuple[str, ...]:
    """Every hazard that was looked for: one that never came is a result too."""
    return tuple(sorted({name for row in rows for name in row.checked}))


def count(group: str, rows: Sequence[Row], hazards: Sequence[str]) -> Count:
    """Count one group of rows."""
    used = [r for r in rows if r.usable]
    came = [{name for name, _ in r.hazards} for r in used]
    statuses = Counter(r.status for r in used)
    return Count(
        group=group,
        injected=len(used),
        activated=sum(r.t_activation is not None for r in used),
        manifested=sum(r.t_manifest is not None for r in used),
        hazards=tuple(sum(h in names for names in came) for h in hazards),
        any_hazard=sum(bool(names) for names in came),
        alerts=sum(bool(r.alerts) for r in used),
        hazards_without_alert=sum(bool(r.hazards) and not r.alerts for r in used),
        crashed=statuses[Status.CRASHED],
        timeout=statuses[Status.TIMEOUT],
        unusable=len(rows) - len(used),
    )


def counts_by(rows: Sequence[Row], key: Callable[[Row], str]) -> tuple[Count, ...]:
    """One count for each group that `key` makes, in order of their names, and the total last."""
    hazards = hazard_names(rows)
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    parts = tuple(count(name, groups[name], hazards) for name in sorted(groups))
    return (*parts, count("total", rows, hazards))


def by_fault_type(row: Row) -> str:
    return f"{row.module}/{row.fault_type}"


def by_scenario(row: Row) -> str:
    return row.scenario


def by_method(row: Row) -> str:
    return row.method


def count_table(
    counts: Sequence[Count], head: str, hazards: Sequence[str], *, alerts: bool = True
) -> tuple[list[str], list[list[str]]]:
    """Heads and rows of a table of counts; crashes, timeouts and unusable runs only if there are any, and
    `alerts` if the target has some."""
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


def outcome_counts(rows: Iterable[Row]) -> dict[str, int]:
    """How many rows ended how: outcomes of the runs that worked, statuses of those that did not."""
    seen = Counter(row.ending for row in rows)
    order = [o.value for o in Outcome] + [s.value for s in Status if s is not Status.OK]
    return {name: seen[name] for name in order if seen[name]}


def row_from(line: Mapping[str, str]) -> Row:
    """The row of a line of results.csv, by column; KeyError or ValueError when it is none."""
    checked = [name for name in hazards_in(line) if line[name.lower()]]
    times = {name: line[f"t_{name.lower()}"] for name in checked}
    hazards = [(name, float(time)) for name, time in times.items() if time]
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
        hazards=tuple(sorted(hazards, key=lambda h: h[1])),
        alerts=tuple(a for a in line["alerts"].split(";") if a),
        t_alert=_number(line["t_alert"]),
        reaction_time=_number(line["reaction_time"]),
        detail=line["detail"],
        severity=line.get("severity", ""),
        delta_v=_number(line.get(DELTA_V, "")),
        margins=_margins(line, [name for name, _ in hazards] or checked),
    )


def _margins(line: Mapping[str, str], hazards: Sequence[str]) -> tuple[tuple[str, float], ...]:
    texts = [(name, line.get(f"margin_{name.lower()}", "")) for name in hazards]
    return tuple((name, float(text)) for name, text in texts if text)


def _number(text: str) -> float | None:
    return float(text) if text else None
