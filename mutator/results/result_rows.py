"""The rows of a frame of results as objects."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan
from typing import TYPE_CHECKING, Any

from mutator.families.family_facts import FamilyFacts
from mutator.model import Fault, Outcome, Status, Value, fault_label
from mutator.results.columns_of_golden_hazards import GOLDEN_CLASS
from mutator.results.experiment_sentence import ExperimentSentences
from mutator.results.outcome_counting import (
    UNUSABLE_ENDINGS,
    fault_types_of,
    first_hazard_times,
    hazard_margins,
    outcome_or_status_of_rows,
)
from mutator.results.plan_columns import numeric_value_of
from mutator.results.table_columns import alert_names_in
from mutator.targets.hazard_severity import DELTA_V_NAME
from mutator.targets.stored_target_facts import DRIVE_END_COLUMN

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultRow:
    """One row of the results table. Times are in simulated seconds; None: the event did not happen."""

    experiment_id: str
    kind: str  # fault type: `sensor/bias`
    variant: str
    value: Value  # with the digits of the plan; None without a value, and if it is text
    unit: str
    scenario: str
    scenario_label: str  # the scenario, or its family and values: `follow, ego 60 km/h, gap 20 m`
    trigger: str
    status: Status
    outcome: Outcome | None
    ending: str  # the outcome, or the status if the run failed
    t_activation: float | None
    t_manifest: float | None
    hazards: tuple[tuple[str, float], ...]
    alerts: tuple[str, ...]
    t_alert: float | None
    reaction_time: float | None
    detail: str
    severity: str = ""  # highest class of a hazard in the drive
    severity_label: str = ""  # the class in words, if a scale is known
    delta_v: float | None = None  # delta-v of that contact in m/s
    t_end: float | None = None  # when a terminal hazard or a lost value ended the drive
    margins: tuple[tuple[str, float], ...] = ()  # by hazard: those that occurred or, if none did, all
    golden_class: str = ""  # class of the golden run; '' if all of the run are hazard-free
    sentence: str = ""  # what happened, in words; '' if the phrases are unknown

    @property
    def margin(self) -> float | None:
        """The smallest margin, in the unit of its hazard."""
        return min((margin for _, margin in self.margins), default=None)

    @property
    def usable(self) -> bool:
        return self.status not in UNUSABLE_ENDINGS and self.outcome not in UNUSABLE_ENDINGS

    @property
    def summary(self) -> str:
        """What happened, in words: the sentence; if there is none, the hazards, the detail or the ending."""
        hazards = ", ".join(f"{name} at {time:.2f} s" for name, time in self.hazards)
        return self.sentence or hazards or self.detail or self.ending

    @property
    def fault(self) -> str:
        return fault_label(f"{self.kind}/{self.variant}", self.value, self.unit)


def cells_by_row(frame: "pd.DataFrame") -> list[dict[str, Any]]:
    """Return the cells of each row of a frame of results, by column. A number without a value is None."""
    columns = {str(name): frame[name].tolist() for name in frame}
    for name, cells in columns.items():
        if frame[name].dtype.kind == "f":
            columns[name] = [None if cell != cell else cell for cell in cells]
    return [dict(zip(columns, cells, strict=True)) for cells in zip(*columns.values(), strict=True)]


def rows_of(
    frame: "pd.DataFrame", faults: Mapping[str, Fault], sentences: ExperimentSentences | None = None
) -> list[ResultRow]:
    """Return the rows of a frame of results. `faults` are those of the plan, by id, which has the digits of
    each value (35), while the table has a float. Rows have a sentence only with `sentences`.
    """
    lines = cells_by_row(frame.assign(kind=fault_types_of(frame), ending=outcome_or_status_of_rows(frame)))
    hazards, margins = _cells_with_value(first_hazard_times(frame)), _cells_with_value(hazard_margins(frame))
    families = {family.name: family for family in frame.attrs.get("families", ())}
    rows = zip(lines, hazards, margins, strict=True)
    return [
        _build_row(
            cells,
            row_hazards,
            row_margins,
            faults.get(cells["fault_id"]),
            sentences,
            families.get(cells.get("family", "")),
        )
        for cells, row_hazards, row_margins in rows
    ]


def _cells_with_value(frame: "pd.DataFrame") -> list[tuple[tuple[str, float], ...]]:
    """Return the names and the cells of each row. Cells without a value are left out."""
    columns = [(str(name), cells.tolist()) for name, cells in frame.items()]
    return [
        tuple((name, cells[row]) for name, cells in columns if not isnan(cells[row]))
        for row in range(len(frame))
    ]


def _build_row(
    cells: Mapping[str, Any],
    hazards: tuple[tuple[str, float], ...],
    margins: tuple[tuple[str, float], ...],
    fault: Fault | None,
    sentences: ExperimentSentences | None,
    family: FamilyFacts | None,
) -> ResultRow:
    return ResultRow(
        experiment_id=cells["experiment_id"],
        kind=cells["kind"],
        variant=cells["variant"],
        value=numeric_value_of(fault) if fault else cells["value"],
        unit=cells["unit"],
        scenario=cells["scenario"],
        scenario_label=family.describe(cells) if family else cells["scenario"],
        trigger=cells["trigger"],
        status=Status(cells["status"]),
        outcome=Outcome(cells["outcome"]) if cells["outcome"] else None,
        ending=cells["ending"],
        t_activation=cells["t_activation"],
        t_manifest=cells["t_manifest"],
        hazards=tuple(sorted(hazards, key=lambda hazard: hazard[1])),
        alerts=alert_names_in(cells["alerts"]),
        t_alert=cells["t_alert"],
        reaction_time=cells["reaction_time"],
        detail=cells["detail"],
        severity=cells.get("severity", ""),
        delta_v=cells.get(DELTA_V_NAME),
        t_end=cells.get(DRIVE_END_COLUMN),
        margins=margins,
        golden_class=cells.get(GOLDEN_CLASS, ""),
        sentence=sentences.sentence(cells, fault) if sentences and fault else "",
    )
