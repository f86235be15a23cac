"""Generate the pages on result columns and channels."""

from collections.abc import Iterable, Iterator

from mutator._common.table_rendering import TextTable
from mutator.reference.yaml_key_tables import generated_page_head
from mutator.results.columns_of_defences import (
    AUTHORITY_PREFIX,
    COLUMNS_OF_EVERY_DEFENCE,
    DEFENCE,
    DRIVER_AT_END,
)
from mutator.results.columns_of_golden_hazards import golden_class_columns
from mutator.results.csv_and_parquet_writers import ARROW_TYPE_BY_COLUMN_TYPE, TableColumn
from mutator.results.plan_columns import plan_column_names
from mutator.results.propagation_columns import PROPAGATION_COLUMNS as PROPAGATION
from mutator.results.severity_and_sentence_columns import severity_and_time_columns
from mutator.results.table_columns import TIMING_COLUMNS, result_columns
from mutator.targets.channels import Channel
from mutator.targets.hazard_and_metric_definitions import Hazard, Metric
from mutator.targets.hazard_severity import DELTA_V_NAME
from mutator.targets.manifest import TargetManifest
from mutator.targets.observed_values import unit_and_meaning_by_name
from mutator.targets.stored_target_facts import metric_facts
from mutator.workspace import Workspace


def render_results_page(workspace: Workspace) -> str:
    left_out = ", ".join(f"`{name}`" for name in plan_column_names())
    manifests = [workspace.manifest(name) for name in workspace.targets]
    return "\n".join(
        [
            generated_page_head("Result columns"),
            "`results.csv` and `results.parquet` of a [run folder](run-folder.md) have one row for "
            "each experiment "
            "with a record,\nsorted by id. An empty cell means that there is no value. A *flag* is 0 or "
            "1. Times are "
            "seconds since the start of the simulation.\n[Verdicts](../explanation/verdicts.md) defines "
            "the terms.\n",
            "The target's [manifest](target-manifest.md) names its hazards and compared channels. A hazard "
            "has two columns:\nits name in lower case, and `t_` with that name. A channel has one column: "
            "`max_dev_` with the first word of its\nname, or with its whole name if two channels start with "
            "the same word. Margins of hazards and metrics have the\nnames that the manifest gives them.\n",
            "A run with scenarios of [families](family.md) has the column `family`, and one for each "
            "parameter, with its key as name\n(`ego_kph`). They are empty for other scenarios. `scenario` "
            "is then the family and the beginning of a digest.\n",
            f"A run with [defences](defence.md) has the columns from `{DEFENCE}` on, then "
            f"`{AUTHORITY_PREFIX}<command>`, the value furthest from 0\nof each command that a defence "
            f"gave, and the flag `{DRIVER_AT_END}`: whether a defence with the role `driver` acted in the "
            "last\nstep.\n",
            *(line for manifest in manifests for line in _result_columns_section(manifest)),
            "## plan.csv\n",
            f"`plan.csv` has the columns that are known before a run: {left_out}.\n"
            "With families, `family` and the parameters follow, except in a bench.\n",
            "## propagation.parquet\n",
            "One row for each channel of an experiment that differed from the golden run by more than its "
            "tolerance, in the order of\nexperiments and of the manifest's channels. [Fault "
            "paths](../explanation/fault-paths.md) explains how a path follows from\nthese rows.\n",
            *_columns_table(PROPAGATION),
            "## timings.parquet\n",
            "The cost of each experiment in its newest run. It is a separate table because it varies from "
            "run to run.\n",
            *_columns_table(TIMING_COLUMNS),
        ]
    )


def _result_columns_section(manifest: TargetManifest) -> Iterator[str]:
    yield f"## Target {manifest.name}\n"
    compared = [channel.name for channel in manifest.compared_channels]
    severity = severity_and_time_columns(has_classes=manifest.severity is not None)
    columns = (manifest.hazard_names, compared, metric_facts(manifest), severity)
    golden_classes = golden_class_columns((), several_seeds=False)
    yield from _columns_table(
        result_columns(
            *columns,
            paths=True,
            speed=True,
            golden_classes=golden_classes,
            defences=COLUMNS_OF_EVERY_DEFENCE,
        )
    )


def _columns_table(columns: Iterable[TableColumn]) -> Iterator[str]:
    heads = ("column", "type", "Parquet", "unit", "meaning")
    rows = [
        (f"`{c.name}`", c.type, ARROW_TYPE_BY_COLUMN_TYPE[c.type], c.unit or "-", c.about) for c in columns
    ]
    yield TextTable(heads=heads, rows=rows).as_markdown(escape=False)
    yield ""


def render_channels_page(workspace: Workspace) -> str:
    manifests = [workspace.manifest(name) for name in workspace.targets]
    parts = [
        generated_page_head("Channels and units"),
        "This page lists the variables, channels, hazards and metrics that the "
        "[manifest](target-manifest.md) of each target declares.\nInternally, all values are in SI units "
        "and radians. Files and tables can use other units, which the names of\nkeys and columns "
        "contain ([units](fault-spec.md#units)).\n",
    ]
    for manifest in manifests:
        parts += _target_section(manifest)
    return "\n".join(parts).rstrip() + "\n"


def _target_section(manifest: TargetManifest) -> Iterator[str]:
    yield f"## {manifest.name}\n"
    yield "Triggers and contexts can use these variables:\n"
    observed_variables = unit_and_meaning_by_name(manifest.observation)
    variables = [(f"`{name}`", *unit_and_meaning) for name, unit_and_meaning in observed_variables.items()]
    yield TextTable(heads=("variable", "unit", "meaning"), rows=variables).as_markdown(escape=False)
    yield ""
    yield (
        f"A trace in `{manifest.trace_file}` has one array for each channel, with one value for each step of "
        f"{manifest.step_s:g} s. `{manifest.time_channel}` is the time in s.\n"
    )
    rows = [_channel_row(channel) for channel in manifest.channels]
    yield TextTable(heads=("channel", "unit", "role", "component", "meaning"), rows=rows).as_markdown(
        escape=False
    )
    yield ""
    hazards = [_hazard_row(hazard) for hazard in manifest.hazard_rules]
    yield TextTable(heads=("hazard", "condition", "ends the drive", "meaning"), rows=hazards).as_markdown(
        escape=False
    )
    yield ""
    metrics = [_metric_row(metric) for metric in manifest.all_metrics]
    if metrics:
        yield TextTable(heads=("metric", "unit", "is", "worse", "meaning"), rows=metrics).as_markdown(
            escape=False
        )
        yield ""
    yield f"Alerts: {', '.join(manifest.alerts) or 'none'}.\n"
    changes = [
        (f"`{name}`", f"`{' '.join(arguments)}`") for name, arguments in manifest.args_by_change.items()
    ]
    yield TextTable(heads=("change of the scenario", "arguments it adds"), rows=changes).as_markdown(
        escape=False
    )
    yield ""


def _channel_row(channel: Channel) -> tuple[str, ...]:
    has_special_tolerance = channel.tolerance != channel.role.default_tolerance
    role = f"{channel.role}, to {channel.tolerance:g}" if has_special_tolerance else str(channel.role)
    return f"`{channel.name}`", channel.unit, role, channel.component or "-", channel.about or "-"


def _hazard_row(hazard: Hazard) -> tuple[str, ...]:
    condition = f"`{hazard.when or hazard.required_stl}`" if not hazard.is_in_record else "as recorded"
    if hazard.for_s:
        condition += f" for {hazard.for_s:g} s"
    ends = {"": "no", "True": "yes"}.get(hazard.terminal_condition, f"`{hazard.terminal_condition}`")
    return hazard.name, condition, ends, hazard.about or "-"


def _metric_row(metric: Metric) -> tuple[str, ...]:
    if metric.name == DELTA_V_NAME:
        definition = "as in `severity`"
    elif metric.hazard:
        definition = f"`{metric.step_formula}` when {metric.hazard} first occurs"
    elif metric.step_formula:
        definition = f"{metric.aggregate} of `{metric.step_formula}`"
    else:
        definition = "min of the hazard's robustness"
    if metric.where:
        definition += f" where `{metric.where}`"
    about = f"{metric.about} ({metric.source})" if metric.source else metric.about
    return f"`{metric.name}`", metric.unit, definition, metric.worse, about
