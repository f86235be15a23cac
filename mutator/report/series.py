"""Golden against faulty over time, as the report's page draws them: thinned so that no eye sees it.

The page carries those of a few chosen experiments. Others are files, report/series/<experiment>.js, which
the page loads when such an experiment is opened; a script is what a page opened from a disk may load.
"""

from collections.abc import Container, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mutator._common.files import write_atomic
from mutator.errors import MutatorError
from mutator.execution.traces import Traces
from mutator.figures.run_plot import finite, marks_of
from mutator.model import Record, Status
from mutator.outcomes.golden import Trace, times_of
from mutator.outcomes.rows import Row
from mutator.report.panel import FOLDER as REPORT
from mutator.store.run_folder import RunFolder
from mutator.targets.channels import Channel
from mutator.targets.manifest import TargetManifest
from mutator.web import packed

if TYPE_CHECKING:
    from mutator.workspace import Workspace

FOLDER = "series"
SCHEMA = "report-series/1"
BUCKETS = (
    480  # stretches of time, of which highest and lowest value are kept: a plot is about as many dots wide
)
STRIP = 160  # stretches of the strip of differences
LEVELS = 9  # of it, above none
DIGITS = 5  # of a value: more than a plot of any size shows
CHOSEN, ONE_IN = 24, 20  # at most so many are driven again for the page, and one of so many experiments


def chosen(rows: Sequence[Row]) -> list[str]:
    """The experiments whose series the page carries: of each fault type one that ended in its most frequent
    hazards, then of each one that ended in the next, and so on; always the first by id."""
    ends: dict[str, dict[tuple[str, ...], list[str]]] = {}
    for row in rows:
        if row.status is Status.OK and row.t_activation is not None:
            end = tuple(name for name, _ in row.hazards)
            kind = ends.setdefault(f"{row.module}/{row.fault_type}", {})
            kind.setdefault(end or ("", row.ending), []).append(row.experiment_id)
    ranked = []
    for fault_type, cells in ends.items():
        by_weight = sorted(cells.items(), key=lambda cell: (not cell[0][0], -len(cell[1]), cell[0]))
        ranked += [(rank, fault_type, min(ids)) for rank, (_, ids) in enumerate(by_weight)]
    return [name for *_, name in sorted(ranked)[: min(CHOSEN, len(rows) // ONE_IN)]]


def carried(folder: RunFolder, workspace: "Workspace", names: Iterable[str]) -> dict[str, dict[str, Any]]:
    """The series of these experiments; without those that cannot be had any more.

    One without a kept trace is driven again, which takes as long as a run of the target.
    """
    traces, made = Traces(workspace, folder), {}
    for name in names:
        with suppress(MutatorError, KeyError):  # sources have changed, say, or a plan lacks what results have
            golden, faulty = traces.of(name)
            made[name] = packed_series(traces.manifest, golden, faulty, traces.record(name))
    return made


def keep_traces(folder: RunFolder, workspace: "Workspace", but: Container[str]) -> None:
    """Write the series of each experiment whose trace is kept and that is not in `but`."""
    traces = Traces(workspace, folder)
    for name in sorted(path.name for path in (folder.path / "traces").glob("*")):
        if name in but or series_path(folder, name).exists():
            continue
        with suppress(MutatorError, KeyError):
            if traces.is_kept(name):
                golden, faulty = traces.of(name)
                keep(folder, traces.manifest, golden, faulty, traces.record(name))


def keep(folder: RunFolder, manifest: TargetManifest, golden: Trace, faulty: Trace, record: Record) -> Path:
    """Write the series of one experiment to where the page looks for it."""
    path = series_path(folder, record.experiment_id)
    path.parent.mkdir(parents=True, exist_ok=True)
    data = packed(packed_series(manifest, golden, faulty, record))
    write_atomic(path, f'Series.loaded("{record.experiment_id}", "{data}");\n'.encode())
    return path


def series_path(folder: RunFolder, experiment_id: str) -> Path:
    """Where the page looks for the series of an experiment that it does not carry."""
    return folder.path / REPORT / FOLDER / f"{experiment_id}.js"


def kept(out: Path) -> list[str]:
    """The experiments whose series are files of the report in `out`."""
    return sorted(path.stem for path in (out / FOLDER).glob("[0-9a-f]*.js"))


def packed_series(manifest: TargetManifest, golden: Trace, faulty: Trace, record: Record) -> dict[str, Any]:
    """Every channel of the manifest that both runs have, compared ones first; marks and time active."""
    time = manifest.time_channel
    wanted = (*manifest.compared, *manifest.plotted)
    channels = [c for c in wanted if len(golden.get(c.name, ())) and len(faulty.get(c.name, ()))]
    end = float(max(golden[time][-1], faulty[time][-1]))
    active = record.activation
    return {
        "schema": SCHEMA,
        "start": float(golden[time][0]),
        "end": end,
        "active": [active.first, active.last] if active else None,
        "marks": [[mark.kind.value, mark.t, mark.label] for mark in marks_of(record)],
        "channels": [_channel(c, c in manifest.compared, golden, faulty, time) for c in channels],
    }


def _channel(channel: Channel, compared: bool, golden: Trace, faulty: Trace, time: str) -> dict[str, Any]:
    times = [times_of(trace, channel.name, time) for trace in (golden, faulty)]
    lines = [_line(t, finite(trace[channel.name])) for t, trace in zip(times, (golden, faulty), strict=True)]
    rows = min(map(len, times))
    strip, largest = _strip(finite(golden[channel.name])[:rows], finite(faulty[channel.name])[:rows])
    return {
        "name": channel.name,
        "unit": channel.unit,
        "compared": compared,
        "golden": lines[0],
        "faulty": lines[1],
        "strip": strip,  # over the time that both runs have, `until`
        "until": float(times[0][rows - 1]),
        "largest": largest,
    }


def _line(t: np.ndarray, values: np.ndarray) -> list[list[float | None]]:
    """[times, values] of the points that are drawn; None where there is no value."""
    at = thinned(values)
    shown = [None if np.isnan(v) else float(f"{v:.{DIGITS}g}") for v in values[at]]
    return [[round(float(x), 6) for x in t[at]], shown]


def thinned(values: np.ndarray, buckets: int = BUCKETS) -> np.ndarray:
    """Indices of the points that a plot needs: both ends, of each bucket the highest and the lowest, the
    edges of gaps; of a level stretch its ends."""
    count = len(values)
    points = {0, count - 1}
    if count <= 2 * buckets:
        points |= set(range(count))
    else:
        for part in np.array_split(np.arange(count), buckets):
            there = part[~np.isnan(values[part])]
            if there.size:
                points |= {int(there[np.argmin(values[there])]), int(there[np.argmax(values[there])])}
        edges = np.flatnonzero(np.diff(np.isnan(values)))
        points |= {int(i) for edge in edges for i in (edge, edge + 1)}
    at = np.array(sorted(points))
    text = np.nan_to_num(values[at], nan=np.inf)
    inside = np.flatnonzero((text[1:-1] == text[:-2]) & (text[1:-1] == text[2:])) + 1
    return np.delete(at, inside)


def _strip(golden: np.ndarray, faulty: np.ndarray) -> tuple[str, float]:
    """Where the runs differ and how much: a digit for each stretch, 0 for none, 9 for the largest; which
    that is."""
    same = (golden == faulty) | (np.isnan(golden) & np.isnan(faulty))
    gap = np.abs(np.nan_to_num(faulty) - np.nan_to_num(golden))
    gap = np.where(same, 0.0, gap)
    largest = float(gap.max(initial=0.0))
    parts = np.array_split(gap, min(STRIP, len(gap)))
    return "".join(_levels(parts, largest)), float(f"{largest:.{DIGITS}g}")


def _levels(parts: Iterable[np.ndarray], largest: float) -> Iterator[str]:
    for part in parts:
        most = float(part.max(initial=0.0))
        yield str(max(1, round(LEVELS * most / largest))) if most > 0 else "0"
