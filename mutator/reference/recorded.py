"""Pages of what is recorded: the columns of results, and the channels of each target."""

from collections.abc import Iterable, Iterator

from mutator._common.tables import Table
from mutator.outcomes.columns import PLAN_COLUMNS, TIMINGS, Column, result_columns
from mutator.reference.tables import generated
from mutator.targets.manifest import Channel, TargetManifest
from mutator.targets.observation import variable_units
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
            "same word.\n",
            *(line for manifest in manifests for line in _table_of(manifest)),
            "## plan.csv\n",
            f"`plan.csv` has what is known before a run: {left_out}.\n",
            "## timings.parquet\n",
            "What each experiment cost, in its newest run. It is kept apart because it differs from "
            "run to run.\n",
            *_columns(TIMINGS),
        ]
    )


def _table_of(manifest: TargetManifest) -> Iterator[str]:
    yield f"## Target {manifest.name}\n"
    yield from _columns(result_columns(manifest.hazards, [channel.name for channel in manifest.compared]))


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
    rows = [_channel(channel, "compared with golden") for channel in manifest.compared]
    rows += [_channel(channel, "plotted") for channel in manifest.plotted]
    yield Table(heads=("channel", "unit", "role", "meaning"), rows=rows).as_markdown(escape=False)
    yield ""
    yield f"Hazards: {', '.join(manifest.hazards)}. Alerts that count: {', '.join(manifest.alerts)}.\n"
    changes = [(f"`{name}`", f"`{' '.join(words)}`") for name, words in manifest.changes.items()]
    yield Table(heads=("change of the scenario", "arguments it adds"), rows=changes).as_markdown(escape=False)
    yield ""


def _channel(channel: Channel, role: str) -> tuple[str, str, str, str]:
    if channel.tolerance:
        role += f", to {channel.tolerance:g}"
    return f"`{channel.name}`", channel.unit, role, channel.about or "-"
