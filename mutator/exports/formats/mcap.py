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
from mutator.campaigns.filters import compile_filter
from mutator.errors import MutatorError, MutatorWarning
from mutator.execution.run_traces import RunTraces
from mutator.exports import Export, ExportRequest
from mutator.model import Experiment, Record
from mutator.outcomes.golden_comparison import Trace
from mutator.outcomes.trace_files import own_times
from mutator.results.table_reader import Results
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.store.series_folder import SeriesFolder, rerun_command
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

EVENTS = "/events"
KINDS = ("activation", "last_active", "manifested", "alert", "hazard", "end_of_drive")
_VALUE: dict[str, Any] = {"type": ["number", "null"]}  # null: missing or not finite

Values = list[tuple[float, float]]  # time (s) and value


@dataclass(frozen=True, kw_only=True)
class Topic:
    name: str
    about: Mapping[str, str]  # unit, role, component, about
    values: Values


def _write_experiments(request: ExportRequest) -> None:
    """Write `<id>.mcap` into the folder `out` for each experiment that has a series or a kept trace and
    matches the filter `only`.

    MutatorError if the package mcap is missing or no experiment has data; MutatorWarning if some have none.
    """
    folder, out = request.folder, request.out
    content = Content(folder, request.workspace)
    wanted = _chosen(folder, request.parts.only)
    found = [name for name in wanted if content.has(name)]
    remedy = f"rerun one: `mutator rerun {(wanted or ['ID'])[0]} --run {folder.path} --trace`"
    if not found:
        raise MutatorError(
            f"{counted(len(wanted), 'experiment')}, none with a series",
            where=folder.path,
            argument="only",
            expected="experiments with stored series",
            remedy=remedy if wanted else "widen `only`",
        )
    if len(found) < len(wanted):
        missing = next(name for name in wanted if name not in found)
        warnings.warn(
            f"left out for lack of series: {len(wanted) - len(found)} of "
            f"{counted(len(wanted), 'experiment')}, for example {missing}; "
            f"{remedy.replace(wanted[0], missing)}",
            MutatorWarning,
            stacklevel=2,
        )
    make_folder(out)
    for name in found:
        write_atomic(path_below(out, f"{name}.mcap"), content.of(name))


class Content:
    """Builds the files of a run folder's experiments."""

    def __init__(self, folder: RunFolder, workspace: Workspace | None) -> None:
        self._folder = folder
        self._series = SeriesFolder(folder.path)
        self._traces = None if workspace is None else RunTraces(workspace, folder)
        self._records = folder.records()

    @cached_property
    def _experiments(self) -> Mapping[str, Experiment]:
        return {experiment.id: experiment for experiment in plan_file.load_experiments(self._folder.path)}

    def has(self, experiment_id: str) -> bool:
        return self._series.has_series(experiment_id) or self._exact(experiment_id) is not None

    def of(self, experiment_id: str) -> bytes:
        """Return an experiment's file, from its exact traces if kept, else from its series."""
        experiment, record = self._experiments[experiment_id], self._records[experiment_id]
        if (traces := self._exact(experiment_id)) is not None:
            assert self._traces is not None
            manifest = self._traces.manifest
            golden, faulty = (list(_of_trace(trace, manifest)) for trace in traces)
        else:
            golden, faulty = self._of_series(record)
        written = _Written()
        written.metadata("experiment", self._facts(experiment, record))
        for run, topics in (("golden", golden), ("faulty", faulty)):
            for topic in topics:
                written.channel(run, topic)
        written.events(_events(record))
        return written.finish()

    def _exact(self, experiment_id: str) -> tuple[Trace, Trace] | None:
        """Return the kept traces, if both runs have one. MutatorError if a trace does not match its record:
        using the coarser series instead would hide the mismatch.
        """
        kept = self._folder.kept_traces_folder(experiment_id)
        if self._traces is None or not kept.is_dir() or experiment_id not in self._records:
            return None
        golden = self._folder.golden_folder_of(self._experiments[experiment_id])
        faulty = path_below(kept / "faulty", self._traces.manifest.trace_file)
        if not (golden.is_dir() or (kept / "golden").is_dir()) or not faulty.is_file():
            return None
        if not self._traces.is_stored(experiment_id):
            raise MutatorError(
                f"the kept trace of {experiment_id} does not match its record",
                where=faulty,
                expected="the complete trace of the campaign's run",
                remedy=f"rerun the experiment: {rerun_command(self._folder.path, experiment_id)}, "
                f"or delete {kept}",
            )
        return self._traces.traces_of(experiment_id)

    def _of_series(self, record: Record) -> tuple[list[Topic], list[Topic]]:
        found = self._series.load_series(record.experiment_id, record)
        assert found is not None  # `has` was checked
        golden, faulty = found
        points = faulty.points
        topics: tuple[list[Topic], list[Topic]] = ([], [])
        for row, about in enumerate(golden.facts["channels"]):
            own = points.channel_numbers == row
            runs = ((golden, points.golden_values), (faulty, points.faulty_values))
            for told, (run, more) in zip(topics, runs, strict=True):
                pairs = [
                    *_pairs(run.times_of(row), run.channel_values[row]),
                    *_pairs(points.t[own], more[own]),
                ]
                told.append(Topic(name=about["name"], about=_described(about), values=sorted(pairs)))
        return topics

    def _facts(self, experiment: Experiment, record: Record) -> dict[str, str]:
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


class _Written:
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

    def metadata(self, name: str, facts: dict[str, str]) -> None:
        self._writer.add_metadata(name, facts)

    def channel(self, run: str, topic: Topic) -> None:
        unit = topic.about["unit"]
        text = f"{topic.about['about'] or topic.name} [{unit}]"
        schema = self._schema(f"{topic.name} [{unit}]", {"value": {**_VALUE, "description": text}})
        number = self._writer.register_channel(
            topic=f"/{run}/{topic.name}",
            message_encoding="json",
            schema_id=schema,
            metadata=dict(topic.about),
        )
        for t, value in topic.values:
            self._add(number, t, {"value": value if math.isfinite(value) else None})

    def events(self, events: Iterable[tuple[float, str, str]]) -> None:
        fields = {"kind": {"enum": list(KINDS)}, "name": {"type": "string"}, "t": {"type": "number"}}
        schema = self._schema("event", fields)
        number = self._writer.register_channel(topic=EVENTS, message_encoding="json", schema_id=schema)
        for t, kind, name in events:
            self._add(number, t, {"kind": kind, "name": name, "t": t})

    def finish(self) -> bytes:
        first = min((time for time, *_ in self._messages), default=0)
        if first < 0:
            self.metadata("times", {"first_s": f"{first / 1e9:.9g}"})
        zero = min(0, first)
        for sequence, (time, channel, message) in enumerate(sorted(self._messages, key=lambda m: m[:2])):
            data = json.dumps(message).encode()
            at = time - zero
            self._writer.add_message(channel, at, data, publish_time=at, sequence=sequence)
        self._writer.finish()  # type: ignore[no-untyped-call]
        return self._data.getvalue()

    def _schema(self, name: str, fields: dict[str, Any]) -> int:
        schema = {"title": name, "type": "object", "properties": fields, "required": list(fields)}
        data = json.dumps(schema).encode()
        number: int = self._writer.register_schema(name=name, encoding="jsonschema", data=data)
        return number

    def _add(self, channel: int, t: float, message: dict[str, Any]) -> None:
        self._messages.append((round(t * 1e9), channel, message))


def _chosen(folder: RunFolder, only: str | None) -> list[str]:
    frame = Results.up_to_date(folder.path).indexed_frame().reset_index()
    if only is None:
        return list(frame["experiment_id"])
    accepts = compile_filter(only, tuple(map(str, frame.columns)))
    rows = frame.astype(object).where(frame.notna(), None).to_dict("records")
    return [row["experiment_id"] for row in rows if accepts({str(k): v for k, v in row.items()})]


def _of_trace(trace: Trace, manifest: TargetManifest) -> Iterator[Topic]:
    for channel in (*manifest.compared_channels, *manifest.plotted_channels):
        if channel.name in trace:
            clock = own_times(channel.name)
            time = trace[clock if clock in trace else manifest.time_channel]
            about = {"unit": channel.unit, "role": channel.role.value}
            about |= {"component": channel.component, "about": channel.about}
            yield Topic(name=channel.name, about=about, values=_pairs(time, trace[channel.name]))


def _described(about: Mapping[str, Any]) -> dict[str, str]:
    return {name: str(about[name]) for name in ("unit", "role", "component", "about")}


def _pairs(time: np.ndarray, values: np.ndarray) -> Values:
    return list(zip(time.tolist(), values.astype(float).tolist(), strict=True))


def _events(record: Record) -> Iterator[tuple[float, str, str]]:
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
