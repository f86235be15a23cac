"""Write experiments as MCAP files: the golden and the faulty run as two sets of topics, events as messages.

Each experiment has a file: `/golden/CHANNEL` and `/faulty/CHANNEL` with a message for each stored value, and
`/events`. Messages are JSON with schemas; log times are simulated time in ns. Log times cannot be negative:
if the run begins before 0, log time 0 is the first message, whose simulated time is in the metadata `times`.
"""

import io
import json
import math
import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mutator._common.confined_files import path_below
from mutator._common.files import make_folder, write_atomic
from mutator._common.message_text import counted
from mutator.campaigns.row_filters import matching_items
from mutator.errors import MutatorError, MutatorWarning
from mutator.execution.run_traces import RunTraces
from mutator.exports import Export, ExportRequest
from mutator.model import Experiment, Record
from mutator.outcomes.trace_and_record_loading import Trace
from mutator.outcomes.trace_files import own_times
from mutator.results.table_reader import Results
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.store.time_series_folder import TimeSeriesFolder, rerun_command
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

EVENTS_TOPIC = "/events"
EVENT_KINDS = ("activation", "last_active", "manifested", "alert", "hazard", "end_of_drive")
_VALUE_SCHEMA: dict[str, Any] = {"type": ["number", "null"]}  # null: missing or not finite

TimedValues = list[tuple[float, float]]  # time (s) and value


@dataclass(frozen=True, kw_only=True)
class TraceTopic:
    name: str
    metadata: Mapping[str, str]  # unit, role, component, about
    values: TimedValues


def _write_experiments(request: ExportRequest) -> None:
    """Write `<id>.mcap` into the folder `out` for each experiment that has a series or a kept trace and
    matches the filter `only`.

    MutatorError if the package mcap is missing or no experiment has data; MutatorWarning if some have none.
    """
    folder, out = request.folder, request.out
    builder = ExperimentFileBuilder(folder, request.workspace)
    selected_ids = _selected_ids(folder, request.selection.only)
    ids_with_data = [name for name in selected_ids if builder.has_data(name)]
    remedy = f"rerun one: `mutator rerun {(selected_ids or ['ID'])[0]} --run {folder.path} --trace`"
    if not ids_with_data:
        raise MutatorError(
            f"{counted(len(selected_ids), 'experiment')}, none with a series",
            where=folder.path,
            argument="only",
            expected="experiments with stored series",
            remedy=remedy if selected_ids else "widen `only`",
        )
    if len(ids_with_data) < len(selected_ids):
        missing = next(name for name in selected_ids if name not in ids_with_data)
        warnings.warn(
            f"left out for lack of series: {len(selected_ids) - len(ids_with_data)} of "
            f"{counted(len(selected_ids), 'experiment')}, for example {missing}; "
            f"{remedy.replace(selected_ids[0], missing)}",
            MutatorWarning,
            stacklevel=2,
        )
    make_folder(out)
    for name in ids_with_data:
        write_atomic(path_below(out, f"{name}.mcap"), builder.file_bytes(name))


class ExperimentFileBuilder:
    """Builds the files of a run folder's experiments."""

    def __init__(self, folder: RunFolder, workspace: Workspace | None) -> None:
        self._folder = folder
        self._series = TimeSeriesFolder(folder.path)
        self._traces = None if workspace is None else RunTraces(workspace, folder)
        self._records = folder.records()

    @cached_property
    def _experiments(self) -> Mapping[str, Experiment]:
        return {experiment.id: experiment for experiment in plan_file.load_experiments(self._folder.path)}

    def has_data(self, experiment_id: str) -> bool:
        return self._series.has_series(experiment_id) or self._stored_traces(experiment_id) is not None

    def file_bytes(self, experiment_id: str) -> bytes:
        """Return an experiment's file, from its exact traces if kept, else from its series."""
        experiment, record = self._experiments[experiment_id], self._records[experiment_id]
        if (traces := self._stored_traces(experiment_id)) is not None:
            assert self._traces is not None
            manifest = self._traces.manifest
            golden, faulty = (list(_trace_topics(trace, manifest)) for trace in traces)
        else:
            golden, faulty = self._series_topics(record)
        writer = _McapWriter()
        writer.add_metadata("experiment", self._experiment_facts(experiment, record))
        for run, topics in (("golden", golden), ("faulty", faulty)):
            for topic in topics:
                writer.add_topic(run, topic)
        writer.add_events(_record_events(record))
        return writer.finish()

    def _stored_traces(self, experiment_id: str) -> tuple[Trace, Trace] | None:
        """Return the kept traces, if both runs have one. MutatorError if a trace does not match its record:
        using the coarser series instead would hide the mismatch.
        """
        trace_folder = self._folder.rerun_traces_folder(experiment_id)
        if self._traces is None or not trace_folder.is_dir() or experiment_id not in self._records:
            return None
        golden = self._folder.golden_folder_of(self._experiments[experiment_id])
        faulty = path_below(trace_folder / "faulty", self._traces.manifest.trace_file)
        if not (golden.is_dir() or (trace_folder / "golden").is_dir()) or not faulty.is_file():
            return None
        if not self._traces.is_faulty_trace_stored(experiment_id):
            raise MutatorError(
                f"the kept trace of {experiment_id} does not match its record",
                where=faulty,
                expected="the complete trace of the campaign's run",
                remedy=f"rerun the experiment: {rerun_command(self._folder.path, experiment_id)}, "
                f"or delete {trace_folder}",
            )
        return self._traces.traces_of(experiment_id)

    def _series_topics(self, record: Record) -> tuple[list[TraceTopic], list[TraceTopic]]:
        stored_series = self._series.load_series(record.experiment_id, record)
        assert stored_series is not None  # `has` was checked
        golden, faulty = stored_series
        points = faulty.extra_points
        topics: tuple[list[TraceTopic], list[TraceTopic]] = ([], [])
        for row, about in enumerate(golden.facts["channels"]):
            is_of_channel = points.channel_numbers == row
            runs = ((golden, points.golden_values), (faulty, points.faulty_values))
            for topics_of_run, (run, more) in zip(topics, runs, strict=True):
                pairs = [
                    *_timed_values(run.times_of(row), run.channel_values[row]),
                    *_timed_values(points.t[is_of_channel], more[is_of_channel]),
                ]
                topics_of_run.append(
                    TraceTopic(name=about["name"], metadata=_topic_metadata(about), values=sorted(pairs))
                )
        return topics

    def _experiment_facts(self, experiment: Experiment, record: Record) -> dict[str, str]:
        head = self._folder.head
        facts = {
            "id": experiment.id,
            "label": experiment.label,
            "scenario": experiment.scenario,
            "changes": ", ".join(experiment.changes),
            "trigger": experiment.trigger.condition,
            "campaign": head.campaign,
            "target": head.target,
            "plan": head.plan,
            "status": record.status.value,
            "outcome": record.outcome.value if record.outcome else "",
        }
        return facts | {name: f"{value:.9g}" for name, value in record.metrics}


class _McapWriter:
    """Collects messages, and writes them in time order."""

    def __init__(self) -> None:
        try:
            from mcap.writer import Writer
        except ImportError:
            raise MutatorError(
                "the package mcap is not installed",
                expected="the package that writes MCAP files",
                remedy="pip install mcap",
            ) from None
        self._data = io.BytesIO()
        self._writer = Writer(self._data)
        self._writer.start(profile="", library="mutator")
        self._messages: list[tuple[int, int, dict[str, Any]]] = []

    def add_metadata(self, name: str, facts: dict[str, str]) -> None:
        self._writer.add_metadata(name, facts)

    def add_topic(self, run: str, topic: TraceTopic) -> None:
        unit = topic.metadata["unit"]
        text = f"{topic.metadata['about'] or topic.name} [{unit}]"
        schema = self._register_schema(
            f"{topic.name} [{unit}]", {"value": {**_VALUE_SCHEMA, "description": text}}
        )
        number = self._writer.register_channel(
            topic=f"/{run}/{topic.name}",
            message_encoding="json",
            schema_id=schema,
            metadata=dict(topic.metadata),
        )
        for t, value in topic.values:
            self._add_message(number, t, {"value": value if math.isfinite(value) else None})

    def add_events(self, events: Iterable[tuple[float, str, str]]) -> None:
        fields = {"kind": {"enum": list(EVENT_KINDS)}, "name": {"type": "string"}, "t": {"type": "number"}}
        schema = self._register_schema("event", fields)
        number = self._writer.register_channel(topic=EVENTS_TOPIC, message_encoding="json", schema_id=schema)
        for t, kind, name in events:
            self._add_message(number, t, {"kind": kind, "name": name, "t": t})

    def finish(self) -> bytes:
        first = min((time for time, *_ in self._messages), default=0)
        if first < 0:
            self.add_metadata("times", {"first_s": f"{first / 1e9:.9g}"})
        zero = min(0, first)
        for sequence, (time, channel, message) in enumerate(sorted(self._messages, key=lambda m: m[:2])):
            data = json.dumps(message).encode()
            at = time - zero
            self._writer.add_message(channel, at, data, publish_time=at, sequence=sequence)
        self._writer.finish()  # type: ignore[no-untyped-call]
        return self._data.getvalue()

    def _register_schema(self, name: str, fields: dict[str, Any]) -> int:
        schema = {"title": name, "type": "object", "properties": fields, "required": list(fields)}
        data = json.dumps(schema).encode()
        number: int = self._writer.register_schema(name=name, encoding="jsonschema", data=data)
        return number

    def _add_message(self, channel: int, t: float, message: dict[str, Any]) -> None:
        self._messages.append((round(t * 1e9), channel, message))


def _selected_ids(folder: RunFolder, only: str | None) -> list[str]:
    frame = Results.up_to_date(folder.path).indexed_frame().reset_index()
    if only is None:
        return list(frame["experiment_id"])
    rows = [
        {str(column): cell for column, cell in row.items()}
        for row in frame.astype(object).where(frame.notna(), None).to_dict("records")
    ]
    columns = tuple(map(str, frame.columns))
    return [row["experiment_id"] for row in matching_items(rows, only, columns, lambda row: row)]


def _trace_topics(trace: Trace, manifest: TargetManifest) -> Iterator[TraceTopic]:
    for channel in (*manifest.compared_channels, *manifest.non_actuator_channels):
        if channel.name in trace:
            clock = own_times(channel.name)
            time = trace[clock if clock in trace else manifest.time_channel]
            about = {"unit": channel.unit, "role": channel.role.value}
            about |= {"component": channel.component, "about": channel.about}
            yield TraceTopic(
                name=channel.name, metadata=about, values=_timed_values(time, trace[channel.name])
            )


def _topic_metadata(about: Mapping[str, Any]) -> dict[str, str]:
    return {name: str(about[name]) for name in ("unit", "role", "component", "about")}


def _timed_values(time: np.ndarray, values: np.ndarray) -> TimedValues:
    return list(zip(time.tolist(), values.astype(float).tolist(), strict=True))


def _record_events(record: Record) -> Iterator[tuple[float, str, str]]:
    if record.activation:
        yield record.activation.first, "activation", ""
        yield record.activation.last, "last_active", ""
    if record.t_manifest is not None:
        yield record.t_manifest, "manifested", ""
    yield from ((t, "alert", name) for name, t in record.alerts)
    yield from ((t, "hazard", name) for name, t in record.hazards)
    if record.t_end is not None:
        yield record.t_end, "end_of_drive", ""


EXPORT = Export(
    about="a folder of traces, one MCAP file per experiment",
    file="mcap",
    write=_write_experiments,
    options=frozenset({"only"}),
    uses_library=True,
)
