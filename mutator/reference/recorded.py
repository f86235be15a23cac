"""Pages of what is recorded: the columns of results, and the channels of each target."""

from collections.abc import Iterable, Iterator

from mutator._common.tables import Table
from mutator.outcomes.columns import (
    PLAN_COLUMNS,
    TIMINGS,
    Column,
    metric_columns,
    result_columns,
    severity_columns,
)
from mutator.outcomes.propagation import COLUMNS as PROPAGATION
from mutator.reference.tables import generated
from mutator.targets.channels import Channel
from mutator.targets.judging import Hazard, Metric
from mutator.targets.manifest import TargetManifest
from mutator.targets.observation import variable_units
from mutator.targets.severity import DELTA_V
from mutator.workspace import Workspace

_ARROW = {"text": "string", "flag": "int8", "count": "int64", "number": "double"}


def results(workspace: Workspace) -> str:
    """docs/reference/results.md."""
    left_out = ", ".join(f"`{name}`" for name in PLAN_COLUMNS)
    manifests = [workspace.manifest(name) for name in workspace.targets]
    return "\n".join(
        [
            generated("Result columns"),
            "`results.csv` and `results.parquet` of a [run folder](run-folder.md) have one row for "
            "each experiment "
            "that has a record,\nsorted by id. An empty cell means that there is nothing to tell. A "
            "*flag* is 0 or 1. "
            "Times are seconds of simulation since\nits start. What the words mean is in "
            "[Verdicts](../explanation/verdicts.md).\n",
            "Hazards and compared channels are the target's: its [manifest](target-manifest.md) names them. "
            "A hazard has two\ncolumns, its name in small letters and `t_` and that name. A channel has one, "
            "`max_dev_` and the first word of its\nname, or its whole name where two channels begin with the "
            "same word. Margins of hazards and metrics\nhave the names that the manifest gives them.\n",
            *(line for manifest in manifests for line in _table_of(manifest)),
            "## plan.csv\n",
            f"`plan.csv` has what is known before a run: {left_out}.\n",
            "## propagation.parquet\n",
            "One row for each channel of an experiment that left golden beyond its tolerance, in the order "
            "of experiments and of\nthe manifest's channels. How a path follows from it is in "
            "[Fault paths](../explanation/fault-paths.md).\n",
            *_columns(PROPAGATION),
            "## timings.parquet\n",
            "What each experiment cost, in its newest run. It is kept apart because it differs from "
            "run to run.\n",
            *_columns(TIMINGS),
        ]
    )


def _table_of(manifest: TargetManifest) -> Iterator[str]:
    yield f"## Target {manifest.name}\n"
    compared = [channel.name for channel in manifest.compared]
    severity = severity_columns({"severity": manifest.contact})
    columns = (manifest.hazards, compared, metric_columns(manifest), severity)
    yield from _columns(result_columns(*columns, paths=True))


def _columns(columns: Iterable[Column]) -> Iterator[str]:
    heads = ("column", "type", "Parquet", "unit", "meaning")
    rows = [(f"`{c.name}`", c.type, _ARROW[c.type], c.unit or "-", c.about) for c in columns]
    yield Table(heads=heads, rows=rows).as_markdown(escape=False)
    yield ""


def channels(workspace: Workspace) -> str:
    """docs/reference/channels.md."""
    manifests = [workspace.manifest(name) for name in workspace.targets]
    parts = [
        generated("Channels and units"),
        "What is observed, recorded and compared of each target of the library, as its "
        "[manifest](target-manifest.md) says.\nInside everything is SI and radians; other units are "
        "for files and "
        "tables alone, and stand in the names there\n([units](fault-spec.md#units)).\n",
    ]
    for manifest in manifests:
        parts += _target(manifest)
    return "\n".join(parts).rstrip() + "\n"


def _target(manifest: TargetManifest) -> Iterator[str]:
    yield f"## {manifest.name}\n"
    yield "Triggers and contexts can ask for:\n"
    observed = variable_units(manifest.observation)
    variables = [(f"`{name}`", *told) for name, told in observed.items()]
    yield Table(heads=("variable", "unit", "meaning"), rows=variables).as_markdown(escape=False)
    yield ""
    yield (
        f"A trace is an array for each channel in `{manifest.trace_file}`, with a value for each step of "
        f"{manifest.step_s:g} s; `{manifest.time_channel}` is the time in s.\n"
    )
    rows = [_channel(channel) for channel in manifest.channels]
    yield Table(heads=("channel", "unit", "role", "component", "meaning"), rows=rows).as_markdown(
        escape=False
    )
    yield ""
    hazards = [_hazard(hazard) for hazard in manifest.rules]
    yield Table(heads=("hazard", "comes when", "ends the drive", "meaning"), rows=hazards).as_markdown(
        escape=False
    )
    yield ""
    metrics = [_metric(metric) for metric in manifest.measures]
    if metrics:
        yield Table(heads=("metric", "unit", "is", "worse", "meaning"), rows=metrics).as_markdown(
            escape=False
        )
        yield ""
    yield f"Alerts that count: {', '.join(manifest.alerts) or 'none'}.\n"
    changes = [(f"`{name}`", f"`{' '.join(words)}`") for name, words in manifest.changes.items()]
    yield Table(heads=("change of the scenario", "arguments it adds"), rows=changes).as_markdown(escape=False)
    yield ""


def _channel(channel: Channel) -> tuple[str, ...]:
    own = channel.tolerance != channel.role.tolerance
    role = f"{channel.role}, to {channel.tolerance:g}" if own else str(channel.role)
    return f"`{channel.name}`", channel.unit, role, channel.component or "-", channel.about or "-"


def _hazard(hazard: Hazard) -> tuple[str, ...]:
    when = f"`{hazard.when or hazard.stl}`" if not hazard.recorded else "the record says so"
    if hazard.for_s:
        when += f" for {hazard.for_s:g} s"
    ends = {"": "no", "True": "yes"}.get(hazard.terminal, f"`{hazard.terminal}`")
    return hazard.name, when, ends, hazard.about or "-"


def _metric(metric: Metric) -> tuple[str, ...]:
    if metric.name == DELTA_V:
        what = "what `severity` says"
    elif metric.formula:
        what = f"{metric.aggregate} of `{metric.formula}`"
    else:
        what = "min of its robustness"
    if metric.where:
        what += f" where `{metric.where}`"
    about = f"{metric.about} ({metric.source})" if metric.source else metric.about
    return f"`{metric.name}`", metric.unit, what, metric.worse, about
