"""Figures of all experiments of a run: a fault's values, and how soon hazards come."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mutator._common.message_text import describe_choices
from mutator.api.run_contents import RunContents
from mutator.errors import MutatorError
from mutator.figures.fault_value_and_hazard_time_figures import draw_times_to_hazard, draw_values
from mutator.statistics.results_frame import prepare_results
from mutator.statistics.sheet_selection import DEFAULT_DRIVER_REACTION_S
from mutator.targets.hazard_severity import DELTA_V_NAME
from mutator.targets.stored_target_facts import DRIVE_END_COLUMN

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

_TIME = "time_to_hazard"
_MARGIN_PREFIX = "margin_"


@dataclass(frozen=True, eq=False, repr=False)
class RunFigures(RunContents):
    """A run folder with figures of its experiments."""

    def plot_values(self, fault: str, y: str | None = None) -> "Figure":
        """Plot the experiments of a fault: its value, in the spec's unit, against `y`, with the scenario as
        colour and shape, and the limit as a dashed line. Filled marks have a hazard.

        `fault` is a variant (`sensor/bias/distance`) or a fault type (`sensor/bias`). `y` is a column of
        `results`: a margin (`margin_near`), `delta_v`, `time_to_hazard` or another metric; default: the
        margin that most of the experiments are beyond. Experiments in which the fault was never active, and
        those without a finite `y`, are left out. MutatorError for a fault without numbers as values, such as
        noise, and for an unknown name.
        """
        rows = self._rows_with_values(fault)
        y_unit_by_column = self._y_unit_by_column()
        column = y or self._most_exceeded_margin(rows, list(y_unit_by_column))
        if column not in y_unit_by_column:
            raise MutatorError(repr(column), argument="y", expected=describe_choices(list(y_unit_by_column)))
        points = rows[rows["is_activated"]].assign(y=rows[column].astype(float))
        points = points[points["y"].abs() < float("inf")]
        return draw_values(
            points,
            title=f"{fault}: {len(points)} experiments",
            x_label=_with_unit("value", str(rows["unit"].iloc[0])),
            y_label=_with_unit(column.replace("_", " "), y_unit_by_column[column]),
            limits=self._limits(column),
        )

    def plot_times_to_hazard(
        self, fault: str | None = None, *, reaction_time_s: float | None = None
    ) -> "Figure":
        """Plot the share of hazards that have come by each time from the activation, for all faults and, if
        given, for one `fault` (a variant or a fault type), with a line at a reaction time; default: 1.8 s, a
        driver's to a visible warning.

        The legend has the shares at the reaction time, with 95 % Wilson intervals.
        """
        frame = prepare_results(self._results_frame)
        rows = None if fault is None else _rows_of_fault(frame, fault)
        reaction_s = DEFAULT_DRIVER_REACTION_S if reaction_time_s is None else reaction_time_s
        return draw_times_to_hazard(frame, rows, reaction_s)

    def _rows_with_values(self, fault: str) -> "pd.DataFrame":
        rows = _rows_of_fault(prepare_results(self._results_frame), fault)
        rows = rows[rows["value"].notna()]
        if rows.empty:
            raise MutatorError(fault, argument="fault", expected="a fault with a single number as its value")
        if rows["unit"].nunique() > 1:
            variants = sorted(rows["kind"] + "/" + rows["variant"].astype(str))
            raise MutatorError(
                f"{fault}: values in several units",
                argument="fault",
                expected=describe_choices(list(dict.fromkeys(variants))),
            )
        return rows

    def _y_unit_by_column(self) -> dict[str, str]:
        metrics = {m.name: m.unit for m in self.folder.head.metrics if m.name != DRIVE_END_COLUMN}
        return {**metrics, _TIME: "s"}

    def _most_exceeded_margin(self, rows: "pd.DataFrame", columns: list[str]) -> str:
        margins = [name for name in columns if name.startswith(_MARGIN_PREFIX)]
        return max(margins, key=lambda name: len(rows[rows[name] <= 0]), default=_TIME)

    def _limits(self, column: str) -> list[tuple[float, str]]:
        head = self.folder.head
        if column.startswith(_MARGIN_PREFIX):
            name = column.removeprefix(_MARGIN_PREFIX)
            return [(0.0, f"limit of {next((h for h in head.hazards if h.lower() == name), name)}")]
        if column == DELTA_V_NAME and head.severity:
            labels = head.severity.labels
            return [(least, labels[name]) for name, least, _ in head.severity.classes if least > 0]
        return []


def _rows_of_fault(frame: "pd.DataFrame", fault: str) -> "pd.DataFrame":
    variants = frame["kind"] + "/" + frame["variant"].astype(str)
    rows = frame[(variants == fault) | (frame["kind"] == fault)]
    if rows.empty:
        raise MutatorError(repr(fault), argument="fault", expected=describe_choices(sorted(set(variants))))
    return rows


def _with_unit(text: str, unit: str) -> str:
    return text if unit in ("", "-") else f"{text} [{unit}]"
