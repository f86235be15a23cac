"""Columns of the results table and of its neighbours: names, types, units, meanings.

What is known of an experiment before it runs is in the plan, too.
"""

from dataclasses import dataclass
from typing import Literal

from mutator.model import Experiment

ColumnType = Literal["text", "flag", "count", "number"]


@dataclass(frozen=True, slots=True)
class Column:
    """A column. A `flag` is 0 or 1; `unit` is '' where there is none."""

    name: str
    type: ColumnType
    unit: str
    about: str


RESULTS = (
    Column(
        "experiment_id",
        "text",
        "",
        "the experiment; a content hash: the same input has the same id everywhere",
    ),
    Column("fault_id", "text", "", "its fault, a content hash as well"),
    Column("module", "text", "", "the module of the fault spec"),
    Column("fault_type", "text", "", "the fault type of the spec"),
    Column("reading", "text", "", "the [reading](../explanation/concepts.md#readings) of the fault"),
    Column("value", "number", "as `unit` says", "the value drawn; empty for a fault without one"),
    Column("unit", "text", "", "the unit of `value` as the spec states it, `-` for a plain number"),
    Column("scenario", "text", "", "the scenario driven"),
    Column("method", "text", "", "`guided` (a context triggers) or `random` (a random time does)"),
    Column("trigger", "text", "", "the context, or `random/` and the context of the guided partner"),
    Column("seed", "count", "", "the seed of all that is drawn"),
    Column("status", "text", "", "whether the experiment itself worked"),
    Column("outcome", "text", "", "what the fault did; empty unless the status is `ok`"),
    Column("activated", "flag", "", "whether an injected statement ran while the trigger held"),
    Column("t_activation", "number", "s", "when first"),
    Column("activations", "count", "", "how often"),
    Column("manifested", "flag", "", "whether an actuator output then differed from golden"),
    Column("t_manifest", "number", "s", "when first"),
    Column("h1", "flag", "", "whether hazard H1 came"),
    Column("t_h1", "number", "s", "when first"),
    Column("h2", "flag", "", "whether hazard H2 came"),
    Column("t_h2", "number", "s", "when first"),
    Column("h3", "flag", "", "whether hazard H3 came"),
    Column("t_h3", "number", "s", "when first"),
    Column("alerts", "text", "", "names of the alerts in the order of their times, joined by `;`"),
    Column("t_alert", "number", "s", "time of the first alert"),
    Column(
        "reaction_time", "number", "s", "first hazard minus first alert; empty unless the alert came first"
    ),
    Column("max_dev_gas", "number", "the channel's", "largest difference of gas from golden"),
    Column("max_dev_brake", "number", "the channel's", "largest difference of the brake from golden"),
    Column("max_dev_steer", "number", "the channel's", "largest difference of steering from golden"),
)
EXTRA = (
    Column("variant", "text", "", "the variant of the spec"),
    Column("aim", "text", "", "the hazard that the fault aims at"),
    Column("condition", "text", "", "the condition that the trigger waits for"),
    Column("detail", "text", "", "why the status is not `ok`"),
)
TIMINGS = (
    Column("experiment_id", "text", "", "the experiment"),
    Column("cpu_s", "number", "s", "CPU time of its run"),
    Column("wall_s", "number", "s", "wall time of its run"),
    Column("host", "text", "", "the machine"),
    Column("worker", "text", "", "the worker of the session"),
)
COLUMNS = tuple(column.name for column in RESULTS)
PLAN_COLUMNS = (*COLUMNS[:11], "variant", "aim", "condition")
_TYPES = {column.name: column.type for column in (*RESULTS, *EXTRA)}


def type_of(name: str) -> ColumnType:
    """Type of a column of the results; any other name is a time or a difference of a target's own."""
    return _TYPES.get(name, "number")


def plan_row(experiment: Experiment) -> dict[str, object]:
    """`PLAN_COLUMNS` of one experiment: `variant` of the spec, `condition` that the trigger waits for."""
    fault, trigger = experiment.fault, experiment.trigger
    return {
        "experiment_id": experiment.id,
        "fault_id": fault.id,
        "module": fault.module,
        "fault_type": fault.fault_type,
        "reading": fault.reading,
        "value": fault.value,
        "unit": fault.unit,
        "scenario": experiment.scenario,
        "method": experiment.method.value,
        "trigger": trigger.name,
        "seed": experiment.seed,
        "variant": fault.spec.rpartition("/")[2],
        "aim": fault.aim,
        "condition": trigger.condition,
    }
