"""The columns of plan.csv, which are also columns of the results table: names, types, units, meanings, and
how a cell follows from an experiment.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mutator.families.family_facts import FamilyFacts, ParameterFacts, merged_parameters
from mutator.model import Experiment, Fault, Hold, Value, fault_label
from mutator.results.csv_and_parquet_writers import ColumnType, TableColumn


@dataclass(frozen=True, slots=True)
class PlanColumn(TableColumn):
    """A column that is known before a run."""

    cell_of: Callable[[Experiment], object]


def numeric_value_of(fault: Fault) -> Value:
    """Return the fault's value; None if it is text, which is part of `variant`."""
    return None if isinstance(fault.value, str) else fault.value


def _variant_cell(experiment: Experiment) -> str:
    """Return the variant, with the fault's value if that is text."""
    fault = experiment.fault
    variant = fault.spec.split("/", 2)[-1]
    return fault_label(variant, fault.value, fault.unit) if isinstance(fault.value, str) else variant


def _experiment_hold(experiment: Experiment) -> Hold:
    return experiment.fault.hold or experiment.trigger.hold


FIRST_PLAN_COLUMNS = (
    PlanColumn(
        "experiment_id",
        "text",
        "",
        "the experiment's id, a hash of its content: equal experiments have equal ids on every machine",
        lambda e: e.id,
    ),
    PlanColumn("fault_id", "text", "", "the fault's id, also a hash of its content", lambda e: e.fault.id),
    PlanColumn("module", "text", "", "the module of the fault spec", lambda e: e.fault.module),
    PlanColumn("fault_type", "text", "", "the fault type of the spec", lambda e: e.fault.fault_type),
    PlanColumn(
        "reading",
        "text",
        "",
        "the [reading](../explanation/concepts.md#readings) of the fault",
        lambda e: e.fault.reading,
    ),
    PlanColumn(
        "value",
        "number",
        "as the column `unit` says",
        "the drawn value; empty for a fault without a value",
        lambda e: numeric_value_of(e.fault),
    ),
    PlanColumn(
        "unit",
        "text",
        "",
        "the unit of `value` as the spec states it, `-` for a plain number",
        lambda e: e.fault.unit,
    ),
    PlanColumn(
        "scenario",
        "text",
        "",
        "the scenario; of a family, the name with the beginning of its digest",
        lambda e: e.scenario,
    ),
    PlanColumn(
        "method",
        "text",
        "",
        "`guided` (a context or a listed trigger) or `random` (a random time)",
        lambda e: e.method.value,
    ),
    PlanColumn(
        "trigger",
        "text",
        "",
        "the trigger's name; for a random time, `random/` and the name of the guided partner's trigger",
        lambda e: e.trigger.name,
    ),
    PlanColumn("seed", "count", "", "the seed of all draws", lambda e: e.seed),
)
LAST_PLAN_COLUMNS = (
    PlanColumn(
        "variant",
        "text",
        "",
        "the variant of the spec; for a mutation operator, the place and change",
        _variant_cell,
    ),
    PlanColumn("aim", "text", "", "the hazard that the fault aims at", lambda e: e.fault.aim),
    PlanColumn("condition", "text", "", "the condition of the trigger", lambda e: e.trigger.condition),
)
HOLD_COLUMNS = (  # of results.csv alone
    PlanColumn(
        "hold",
        "text",
        "",
        "how long the fault stays active: `while` the condition holds, `for` a time, or `to_end`",
        lambda e: _experiment_hold(e).value,
    ),
    PlanColumn(
        "hold_s",
        "number",
        "s",
        "how long it stays active with the hold `for`",
        lambda e: e.trigger.hold_s if _experiment_hold(e) is Hold.FOR else None,
    ),
)
FAMILY_COLUMN = PlanColumn(
    "family",
    "text",
    "",
    "the family that gave the scenario; empty for a scenario of the library",
    lambda e: e.concrete.family if e.concrete else None,
)
_COMMON_PLAN_COLUMNS = (*FIRST_PLAN_COLUMNS, *LAST_PLAN_COLUMNS)


def family_columns(families: Sequence[FamilyFacts]) -> tuple[PlanColumn, ...]:
    """Return the columns of a run with scenarios of these families: the family, and each parameter."""
    return (FAMILY_COLUMN, *map(_parameter_column, merged_parameters(families))) if families else ()


def _parameter_column(parameter: ParameterFacts) -> PlanColumn:
    about = f"the scenario's {parameter.name.replace('_', ' ')}; empty if its family has no such parameter"
    column_type: ColumnType = "text" if parameter.is_text else "number"

    def cell_of(experiment: Experiment) -> object:
        value = experiment.concrete.values.get(parameter.key) if experiment.concrete else None
        return str(value) if parameter.is_text and value is not None else value

    return PlanColumn(parameter.key, column_type, parameter.unit, about, cell_of)


def columns_of_plan(families: Sequence[FamilyFacts] = ()) -> tuple[PlanColumn, ...]:
    """Return the columns of plan.csv, in order."""
    return (*_COMMON_PLAN_COLUMNS, *family_columns(families))


def plan_column_names(families: Sequence[FamilyFacts] = ()) -> tuple[str, ...]:
    return tuple(column.name for column in columns_of_plan(families))


def plan_row(
    experiment: Experiment, columns: Sequence[PlanColumn] = _COMMON_PLAN_COLUMNS
) -> dict[str, object]:
    """Return the cells of an experiment by column. If the fault's value is text, it is part of `variant`."""
    return {column.name: column.cell_of(experiment) for column in columns}
