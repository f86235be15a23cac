"""The columns of the results table and related tables: names, types, units, meanings, and how a cell follows
from an experiment and its record.

Hazards, compared channels and metrics of a target add columns; the others are the same for all targets.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

from mutator.errors import MutatorError
from mutator.families.family_facts import FamilyFacts
from mutator.outcomes.verdict_rules import reaction_time
from mutator.results.columns_of_defences import COLUMNS_OF_EVERY_DEFENCE, defence_columns
from mutator.results.columns_of_golden_hazards import AGAINST_GOLDEN, GOLDEN_CLASS, golden_class_columns
from mutator.results.csv_and_parquet_writers import TableColumn
from mutator.results.finished_experiments_and_columns import FinishedExperiment, ResultColumn, rounded_time
from mutator.results.plan_columns import (
    FAMILY_COLUMN,
    FIRST_PLAN_COLUMNS,
    HOLD_COLUMNS,
    LAST_PLAN_COLUMNS,
    PlanColumn,
    family_columns,
)
from mutator.results.severity_and_sentence_columns import (
    FIRST_CHANGE_COLUMNS,
    SPEED_COLUMNS,
    severity_and_time_columns,
)
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest
from mutator.targets.stored_target_facts import DRIVE_END_COLUMN, MetricFacts

if TYPE_CHECKING:
    import pandas as pd

UNIT_OF_CHANNEL = "as its channel"  # a unit

_COLUMNS_TO_MANIFESTATION = (
    ResultColumn(
        "status", "text", "", "whether the experiment itself worked", lambda f: f.record.status.value
    ),
    ResultColumn(
        "outcome",
        "text",
        "",
        "what the fault did; empty unless the status is `ok`",
        lambda f: f.record.outcome.value if f.record.outcome else None,
    ),
    ResultColumn(
        "activated",
        "flag",
        "",
        "whether an injected statement ran while the trigger held",
        lambda f: 1 if f.record.activation else (0 if f.is_ok else None),
    ),
    ResultColumn(
        "t_activation",
        "number",
        "s",
        "time of the first activation",
        lambda f: rounded_time(f.record.activation.first) if f.record.activation else None,
    ),
    ResultColumn(
        "activations",
        "count",
        "",
        "number of activations in the whole run",
        lambda f: f.record.activation.count if f.record.activation else (0 if f.is_ok else None),
    ),
    ResultColumn(
        "manifested",
        "flag",
        "",
        "whether an actuator output differed from golden after the activation",
        lambda f: int(f.record.t_manifest is not None) if f.is_ok else None,
    ),
    ResultColumn(
        "t_manifest",
        "number",
        "s",
        "when an actuator output first differed from golden after the activation",
        lambda f: rounded_time(f.record.t_manifest),
    ),
)
_COLUMNS_TO_REACTION = (
    ResultColumn(
        "alerts",
        "text",
        "",
        "names of the alerts in the order of their times, joined by `;`",
        lambda f: ";".join([name for name, _ in f.record.alerts]) or None,
    ),
    ResultColumn(
        "t_alert",
        "number",
        "s",
        "time of the first alert",
        lambda f: rounded_time(f.record.alerts[0][1]) if f.record.alerts else None,
    ),
    ResultColumn(
        "reaction_time",
        "number",
        "s",
        "time from the first alert to the first hazard; empty unless the alert came first",
        lambda f: rounded_time(reaction_time(f.record.hazards, f.record.alerts)),
    ),
)
PATH_COLUMNS = (
    ResultColumn(
        "reached",
        "text",
        "",
        "the component farthest along the fault's path that left golden",
        lambda f: f.untimed_path.reached or None if f.untimed_path else None,
    ),
    ResultColumn(
        "stopped_at",
        "text",
        "",
        "the components that stopped a masked fault, joined by `;`",
        lambda f: ";".join(f.untimed_path.stopped_at) or None if f.untimed_path else None,
    ),
)
DETAIL_COLUMN = ResultColumn(
    "detail",
    "text",
    "",
    "why the status is not `ok`, why the fault was never active, or why it cannot be judged",
    lambda f: f.record.detail or None,
)
TIMING_COLUMNS = (
    TableColumn("experiment_id", "text", "", "the experiment"),
    TableColumn("cpu_s", "number", "s", "CPU time of the experiment's run"),
    TableColumn("wall_s", "number", "s", "wall time of the experiment's run"),
    TableColumn("host", "text", "", "the machine that ran the experiment"),
    TableColumn("worker", "text", "", "the worker that ran the experiment"),
)
# Columns that are added when the table is read. No hazard can have one of these names.
DERIVED_COLUMN_NAMES = (
    "kind",
    "fault",
    "row",
    "ending",
    "hazards",
    "warning",
    "through",
    "rank",
    "hazard",
    "t_hazard",
)


def result_columns(
    hazards: Iterable[str],
    compared: Sequence[str],
    metrics: Sequence[MetricFacts] = (),
    severity: Sequence[ResultColumn] = (),
    *,
    families: Sequence[FamilyFacts] = (),
    paths: bool = False,
    speed: bool = False,
    golden_classes: Sequence[ResultColumn] = (),
    defences: Sequence[ResultColumn] = (),
) -> tuple[PlanColumn | ResultColumn, ...]:
    """Return the columns of results.csv, in order.

    `severity` is from `severity_columns`, `golden_classes` from `golden_class_columns`, `defences` from
    `defence_columns`. `families` are those of the run's scenarios. `paths` adds the columns of the fault's
    path, `speed` those of the car's speed.
    """
    ends = DRIVE_END_COLUMN in (metric.name for metric in metrics)
    return (
        *FIRST_PLAN_COLUMNS,
        *_COLUMNS_TO_MANIFESTATION,
        *(column for name in hazards for column in hazard_columns(name)),
        *_COLUMNS_TO_REACTION,
        *(_deviation_column(name, column) for name, column in deviation_column_by_channel(compared).items()),
        *map(_metric_column, metrics),
        *(
            _drive_deviation_column(name, column)
            for name, column in drive_deviation_column_by_channel(compared).items()
            if ends
        ),
        *severity,
        *(PATH_COLUMNS if paths else ()),
        *LAST_PLAN_COLUMNS,
        *family_columns(families),
        *HOLD_COLUMNS,
        *FIRST_CHANGE_COLUMNS,
        *(SPEED_COLUMNS if speed else ()),
        *golden_classes,
        *defences,
        DETAIL_COLUMN,
    )


def result_columns_of(folder: RunFolder) -> tuple[PlanColumn | ResultColumn, ...]:
    """Return the columns of a run's results.csv, in order."""
    head, golden_hazards = folder.head, folder.golden_hazards
    paths = any(channel.component for channel in head.channels)
    severity = severity_and_time_columns(has_classes=head.severity is not None)
    return result_columns(
        head.hazards,
        head.compared,
        head.metrics,
        severity,
        families=head.families,
        paths=paths,
        speed=bool(head.speed),
        golden_classes=golden_class_columns(golden_hazards, several_seeds=folder.has_seeded_goldens)
        if golden_hazards
        else (),
        defences=defence_columns(head.defences),
    )


def cells_by_column(
    columns: Iterable[PlanColumn | ResultColumn], finished: Sequence[FinishedExperiment]
) -> list[list[object]]:
    """Return the cells of each column, with a row for each finished experiment."""
    planned = [experiment.experiment for experiment in finished]
    return [
        list(map(column.cell_of, planned))
        if isinstance(column, PlanColumn)
        else list(map(column.cell_of, finished))
        for column in columns
    ]


def row_of(columns: Iterable[PlanColumn | ResultColumn], finished: FinishedExperiment) -> dict[str, object]:
    """Return the cells of one experiment by column."""
    return {
        column.name: column.cell_of(finished.experiment if isinstance(column, PlanColumn) else finished)  # type: ignore[arg-type]
        for column in columns
    }


def _deviation_column(channel: str, column: str) -> ResultColumn:
    about = f"largest difference of `{channel}` from golden"
    return ResultColumn(column, "number", UNIT_OF_CHANNEL, about, lambda f: f.max_dev.get(channel))


def _drive_deviation_column(channel: str, column: str) -> ResultColumn:
    about = f"largest difference of `{channel}` from golden, up to `{DRIVE_END_COLUMN}`"
    return ResultColumn(column, "number", UNIT_OF_CHANNEL, about, lambda f: f.dev.get(channel))


def _metric_column(metric: MetricFacts) -> ResultColumn:
    name = metric.name
    if name == DRIVE_END_COLUMN:
        return ResultColumn(name, "number", metric.unit, metric.about, lambda f: rounded_time(f.record.t_end))
    return ResultColumn(name, "number", metric.unit, metric.about, lambda f: f.metrics.get(name))


@lru_cache(maxsize=64)
def hazard_columns(hazard: str) -> tuple[ResultColumn, ResultColumn]:
    """Return the flag and the time column of a hazard: `near` and `t_near` for NEAR."""
    name = hazard.lower()
    return (
        ResultColumn(
            name,
            "flag",
            "",
            f"whether hazard {hazard} occurred",
            lambda f: int(hazard in f.hazards) if f.is_ok else None,
        ),
        ResultColumn(
            f"t_{name}",
            "number",
            "s",
            "time of its first occurrence",
            lambda f: rounded_time(f.hazards.get(hazard)),
        ),
    )


def alert_names_in(cell: str) -> tuple[str, ...]:
    """Return the names in a cell of the column `alerts`."""
    return tuple(filter(None, cell.split(";")))


def hazard_names_of_frame(frame: "pd.DataFrame") -> tuple[str, ...]:
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


def deviation_column_by_channel(channels: Sequence[str]) -> Mapping[str, str]:
    """Map each compared channel to its column: `max_dev_` and the first word of its name (`wheel` for
    `wheel_turn`), or the whole name if another channel begins with the same word.
    """
    return _cached_deviation_columns(tuple(channels))


@lru_cache(maxsize=64)
def _cached_deviation_columns(channels: tuple[str, ...]) -> Mapping[str, str]:
    words = [name.split("_")[0] for name in channels]
    return {
        name: f"max_dev_{word if words.count(word) == 1 else name}"
        for name, word in zip(channels, words, strict=True)
    }


def drive_deviation_column_by_channel(channels: Sequence[str]) -> dict[str, str]:
    """Map each compared channel to its `dev_` column, which exists if a hazard can end the drive."""
    return {
        name: column.removeprefix("max_") for name, column in deviation_column_by_channel(channels).items()
    }


def check_column_names(manifest: TargetManifest) -> None:
    """Raise MutatorError if a column of a hazard or metric has the name of another column, or if a metric's
    column could be taken for a hazard's.
    """
    used_names = _names_besides_definitions(manifest)
    is_mapping = isinstance(manifest.source.data.get("hazards"), dict)
    for i, hazard in enumerate(manifest.hazard_names):
        names = {column.name for column in hazard_columns(hazard)}
        if names & used_names:
            raise manifest.source.error(
                ("hazards", hazard if is_mapping else i),
                f"hazard '{hazard}' clashes with another column of the results",
                expected=f"a name whose columns ({' and '.join(sorted(names))}) do not exist yet",
                remedy="rename it",
            )
        used_names |= names
    for metric in manifest.all_metrics:
        if {metric.name, f"t_{metric.name}", metric.name.removeprefix("t_")} & used_names:
            raise manifest.source.error(
                ("metrics", metric.name),
                f"metric '{metric.name}' clashes with another column of the results",
                expected="a name that no other column has, with or without the prefix `t_`",
                remedy="rename it",
            )
        used_names.add(metric.name)


def check_parameter_names(manifest: TargetManifest, family: FamilyFacts) -> None:
    """Raise MutatorError if a parameter of a family has the name of another column of this target."""
    used_names = _names_besides_definitions(manifest) | {metric.name for metric in manifest.all_metrics}
    used_names |= {column.name for name in manifest.hazard_names for column in hazard_columns(name)}
    for parameter in family.parameters:
        if parameter.key in used_names:
            raise MutatorError(
                f"parameter '{parameter.key}' of family {family.name} clashes with a column of the results",
                expected="a name that no other column has",
                remedy="rename it in the family file",
            )


def _names_besides_definitions(manifest: TargetManifest) -> set[str]:
    """Return the names of the columns that follow from no hazard, metric or family."""
    compared = [channel.name for channel in manifest.compared_channels]
    columns = result_columns(
        (), compared, paths=True, speed=bool(manifest.speed), defences=COLUMNS_OF_EVERY_DEFENCE
    )
    return {
        *(column.name for column in (*columns, *severity_and_time_columns(has_classes=True), FAMILY_COLUMN)),
        *DERIVED_COLUMN_NAMES,
        DRIVE_END_COLUMN,
        GOLDEN_CLASS,
        AGAINST_GOLDEN,
        *drive_deviation_column_by_channel(compared).values(),
    }
