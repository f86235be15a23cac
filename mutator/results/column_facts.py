"""The columns of the results table and related tables, with names, types, units and meanings.

Hazards, compared channels and metrics of a target add columns; the others are the same for all targets.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Literal

from mutator.errors import MutatorError
from mutator.model import Experiment, fault_label
from mutator.targets.manifest import TargetManifest
from mutator.targets.target_facts import T_END, MetricFacts

if TYPE_CHECKING:
    import pandas as pd

ColumnType = Literal["text", "flag", "count", "number"]


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table. A `flag` is 0 or 1."""

    name: str
    type: ColumnType
    unit: str
    about: str


_OF_PLAN = (
    Column(
        "experiment_id",
        "text",
        "",
        "the experiment's id, a hash of its content: equal experiments have equal ids on every machine",
    ),
    Column("fault_id", "text", "", "the fault's id, also a hash of its content"),
    Column("module", "text", "", "the module of the fault spec"),
    Column("fault_type", "text", "", "the fault type of the spec"),
    Column("reading", "text", "", "the [reading](../explanation/concepts.md#readings) of the fault"),
    Column("value", "number", "as in `unit`", "the drawn value; empty for a fault without a value"),
    Column("unit", "text", "", "the unit of `value` as the spec states it, `-` for a plain number"),
    Column("scenario", "text", "", "the scenario"),
    Column("method", "text", "", "`guided` (a context or a listed trigger) or `random` (a random time)"),
    Column(
        "trigger",
        "text",
        "",
        "the trigger's name; for a random time, `random/` and the name of the guided partner's trigger",
    ),
    Column("seed", "count", "", "the seed of all draws"),
)
_TO_MANIFESTATION = (
    Column("status", "text", "", "whether the experiment itself worked"),
    Column("outcome", "text", "", "what the fault did; empty unless the status is `ok`"),
    Column("activated", "flag", "", "whether an injected statement ran while the trigger held"),
    Column("t_activation", "number", "s", "time of the first activation"),
    Column("activations", "count", "", "number of activations in the whole run"),
    Column("manifested", "flag", "", "whether an actuator output differed from golden after the activation"),
    Column(
        "t_manifest",
        "number",
        "s",
        "when an actuator output first differed from golden after the activation",
    ),
)
_TO_REACTION = (
    Column("alerts", "text", "", "names of the alerts in the order of their times, joined by `;`"),
    Column("t_alert", "number", "s", "time of the first alert"),
    Column(
        "reaction_time",
        "number",
        "s",
        "time from the first alert to the first hazard; empty unless the alert came first",
    ),
)
SEVERITY = Column(
    "severity", "text", "", "class of the contact that ended the drive; empty without a contact"
)
SINCE = (
    Column("fault_tolerant_time", "number", "s", "time from the activation to the first hazard"),
    Column(
        "manifest_to_hazard",
        "number",
        "s",
        "time from the manifestation to the first hazard; empty if the hazard came first",
    ),
)
OF_PATHS = (
    Column("reached", "text", "", "the component farthest along the fault's path that left golden"),
    Column(
        "stopped_at",
        "text",
        "",
        "the components that stopped a masked fault, joined by `;`",
    ),
)
EXTRA = (
    Column("variant", "text", "", "the variant of the spec; for a mutation operator, the place and change"),
    Column("aim", "text", "", "the hazard that the fault aims at"),
    Column("condition", "text", "", "the condition of the trigger"),
    Column("detail", "text", "", "why the status is not `ok`"),
)
TIMINGS = (
    Column("experiment_id", "text", "", "the experiment"),
    Column("cpu_s", "number", "s", "CPU time of the experiment's run"),
    Column("wall_s", "number", "s", "wall time of the experiment's run"),
    Column("host", "text", "", "the machine that ran the experiment"),
    Column("worker", "text", "", "the worker that ran the experiment"),
)
PLAN_COLUMNS = (*(column.name for column in _OF_PLAN), "variant", "aim", "condition")
# Columns that are added when the table is read. No hazard can have one of these names.
_DERIVED_TEXTS = ("kind", "fault", "row", "ending", "hazards", "warning", "through")
DERIVED = (*_DERIVED_TEXTS, "rank", "hazard", "t_hazard")
_PLAIN = (*_OF_PLAN, *_TO_MANIFESTATION, *_TO_REACTION, SEVERITY, *OF_PATHS, *EXTRA)
_TEXTS = {column.name for column in _PLAIN if column.type == "text"}
_TEXTS |= {*_DERIVED_TEXTS}


def result_columns(
    hazards: Iterable[str],
    compared: Sequence[str],
    metrics: Sequence[MetricFacts] = (),
    severity: Sequence[Column] = (),
    *,
    paths: bool = False,
) -> tuple[Column, ...]:
    """Return the columns of results.csv, in order.

    `severity` is from `severity_columns`. `paths` adds the columns of the fault's path.
    """
    return (
        *_OF_PLAN,
        *_TO_MANIFESTATION,
        *(column for name in hazards for column in hazard_columns(name)),
        *_TO_REACTION,
        *(
            Column(column, "number", "the channel's", f"largest difference of `{name}` from golden")
            for name, column in deviation_columns(compared).items()
        ),
        *(Column(metric.name, "number", metric.unit, metric.about) for metric in metrics),
        *(
            Column(
                column,
                "number",
                "the channel's",
                f"largest difference of `{name}` from golden, up to `t_end`",
            )
            for name, column in driven_columns(compared).items()
            if T_END in {metric.name for metric in metrics}
        ),
        *severity,
        *(OF_PATHS if paths else ()),
        *EXTRA,
    )


def severity_columns(head: Mapping[str, Any]) -> tuple[Column, ...]:
    """Return the severity columns according to run.json. Older runs have none."""
    if "severity" not in head:
        return ()
    return (SEVERITY, *SINCE) if head["severity"] else SINCE


def is_text(column: str) -> bool:
    return column in _TEXTS


@lru_cache(maxsize=64)
def hazard_columns(hazard: str) -> tuple[Column, Column]:
    """Return the flag and the time column of a hazard: `near` and `t_near` for NEAR."""
    name = hazard.lower()
    return (
        Column(name, "flag", "", f"whether hazard {hazard} occurred"),
        Column(f"t_{name}", "number", "s", "time of its first occurrence"),
    )


def hazards_of(frame: "pd.DataFrame") -> tuple[str, ...]:
    """Return the hazards of a frame that `Results` read, in the order of run.json. MutatorError for a frame
    without them.
    """
    try:
        return tuple(frame.attrs["hazards"])
    except KeyError:
        raise MutatorError(
            "a frame of results without the names of its hazards",
            expected='`frame.attrs["hazards"]`, which frames of a run have',
            remedy="set it to the names of the target's hazards",
        ) from None


def deviation_columns(channels: Sequence[str]) -> Mapping[str, str]:
    """Map each compared channel to its column: `max_dev_` and the first word of its name (`wheel` for
    `wheel_turn`), or the whole name if another channel begins with the same word.
    """
    return _deviation_columns(tuple(channels))


@lru_cache(maxsize=64)
def _deviation_columns(channels: tuple[str, ...]) -> Mapping[str, str]:
    words = [name.split("_")[0] for name in channels]
    return {
        name: f"max_dev_{word if words.count(word) == 1 else name}"
        for name, word in zip(channels, words, strict=True)
    }


def driven_columns(channels: Sequence[str]) -> dict[str, str]:
    """Map each compared channel to its `dev_` column, which exists if a hazard can end the drive."""
    return {name: column.removeprefix("max_") for name, column in deviation_columns(channels).items()}


def check_names(manifest: TargetManifest) -> None:
    """Raise MutatorError if a column of a hazard or metric has the name of another column, or if a metric's
    column could be taken for a hazard's.
    """
    compared = [channel.name for channel in manifest.compared]
    taken = {column.name for column in result_columns((), compared, paths=True)}
    taken |= {SEVERITY.name, *(column.name for column in SINCE)}
    taken |= {*DERIVED, T_END, *driven_columns(compared).values()}
    named = isinstance(manifest.source.data.get("hazards"), dict)
    for i, hazard in enumerate(manifest.hazards):
        names = {column.name for column in hazard_columns(hazard)}
        if names & taken:
            raise manifest.source.error(
                ("hazards", hazard if named else i),
                f"hazard '{hazard}' clashes with another column of the results",
                expected=f"a name whose columns ({' and '.join(sorted(names))}) do not exist yet",
                remedy="rename it",
            )
        taken |= names
    for metric in manifest.measures:
        if {metric.name, f"t_{metric.name}", metric.name.removeprefix("t_")} & taken:
            raise manifest.source.error(
                ("metrics", metric.name),
                f"metric '{metric.name}' clashes with another column of the results",
                expected="a name that no other column has, with or without the prefix `t_`",
                remedy="rename it",
            )
        taken.add(metric.name)


def plan_row(experiment: Experiment) -> dict[str, object]:
    """Return the `PLAN_COLUMNS` of one experiment. If the fault's value is text, it is part of `variant`."""
    fault, trigger = experiment.fault, experiment.trigger
    variant = fault.spec.split("/", 2)[-1]
    is_text = isinstance(fault.value, str)
    return {
        "experiment_id": experiment.id,
        "fault_id": fault.id,
        "module": fault.module,
        "fault_type": fault.fault_type,
        "reading": fault.reading,
        "value": None if is_text else fault.value,
        "unit": fault.unit,
        "scenario": experiment.scenario,
        "method": experiment.method.value,
        "trigger": trigger.name,
        "seed": experiment.seed,
        "variant": fault_label(variant, fault.value, fault.unit) if is_text else variant,
        "aim": fault.aim,
        "condition": trigger.condition,
    }
