"""Reference traces as CSV: a header, then a row for each time; cells without a value are empty.

Row `time` = t is the state after the simulation step that began at t. Any multiple of 10 ms is accepted.
"""

import csv
from dataclasses import dataclass
from difflib import get_close_matches
from math import isfinite, nan, radians
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from selfdrive.common.conversions import KPH_TO_MS
from selfdrive.common.errors import ConfigError
from selfdrive.sim.recorder import COUNTED_ALERTS, LONG_STATES, PLAN_SOURCES

STEPS_PER_SECOND = 100  # of recorded traces
STEPS_PER_ROW = 5  # steps between written rows

_FCW_BIT = 1 << COUNTED_ALERTS.index("fcw")


class TraceColumn(NamedTuple):
    """One column. `si_factor` converts its numbers to SI; a column with `value_names` has no numbers."""

    name: str
    channel: str
    unit: str = "-"
    si_factor: float = 1.0
    value_names: tuple[str, ...] = ()
    published: bool = False  # from a controller message, visible up to a control cycle later

    @property
    def is_categorical(self) -> bool:
        return self.channel in ("engaged", "fcw", "lead_status") or bool(self.value_names)


COLUMNS = (
    TraceColumn("speed", "v_ego", "m/s"),
    TraceColumn("acceleration", "a_ego", "m/s2"),
    TraceColumn("speed_lead", "v_lead", "m/s"),
    TraceColumn("d_rel", "d_rel", "m"),
    TraceColumn("v_rel", "v_rel", "m/s"),
    TraceColumn("gas", "gas"),
    TraceColumn("brake", "brake"),
    TraceColumn("steer_torque", "steer_torque"),
    TraceColumn("angle_steer", "steer_angle", "rad", radians(1.0)),
    TraceColumn("headway_time", "hwt", "s"),
    TraceColumn("fcw", "fcw", published=True),
    TraceColumn("enabled", "engaged", published=True),
    TraceColumn("long_state", "long_state", value_names=LONG_STATES, published=True),
    TraceColumn("vEgo", "v_ego_est", "m/s", published=True),
    TraceColumn("aEgo", "a_ego_est", "m/s2", published=True),
    TraceColumn("vPid", "v_pid", "m/s", published=True),
    TraceColumn("vCruise", "v_cruise", "m/s", KPH_TO_MS, published=True),
    TraceColumn("plan_vTarget", "v_target", "m/s", published=True),
    TraceColumn("plan_aTarget", "a_target", "m/s2", published=True),
    TraceColumn("plan_source", "plan_source", value_names=PLAN_SOURCES, published=True),
    TraceColumn("lead_status", "lead_status", published=True),
    TraceColumn("lead_dRel", "lead_d_rel", "m", published=True),
    TraceColumn("lead_vRel", "lead_v_rel", "m/s", published=True),
    TraceColumn("lead_vLeadK", "lead_v_lead_k", "m/s", published=True),
    TraceColumn("lead_aLeadK", "lead_a_lead_k", "m/s2", published=True),
    TraceColumn("cum_path", "lateral_offset", "m"),
)
COLUMN_BY_CHANNEL = {column.channel: column for column in COLUMNS}
IGNORED_COLUMNS = ("distance", "distance_lead", "alertText1", "alertText2")  # allowed in a file, but ignored

_COLUMN_BY_NAME = {column.name: column for column in COLUMNS}


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceTrace:
    """A reference trace: `steps` (each row's step of 10 ms), `channels` (values in SI units, NaN where
    empty)."""

    name: str
    path: Path
    steps: np.ndarray
    channels: dict[str, np.ndarray]


def comparable_channels(trace: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The channels of a recorded trace as floats, with `fcw` extracted from the alert bits."""
    channels = {name: np.asarray(values, dtype=float) for name, values in trace.items()}
    channels["fcw"] = (np.asarray(trace["alert"], dtype=int) & _FCW_BIT > 0).astype(float)
    return channels


def load_reference_trace(path: Path) -> ReferenceTrace:
    """Read a reference. Raises ConfigError, with the line, if it is invalid."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:  # some files begin with a byte order mark
            rows = csv.reader(file)
            names = _parse_header(next(rows, []), path)
            lines = [(rows.line_num, row) for row in rows]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else "not comma-separated text"
        raise ConfigError(
            str(reason), where=str(path), expected="a readable CSV trace", remedy="check the path"
        ) from None
    if len(lines) < 2:
        _fail(path, 1, "fewer than two rows", "a row for each time", "record the run again")
    for line, row in lines:
        if len(row) != len(names):
            _fail(path, line, f"cells: {len(row)}", f"{len(names)}, as in the header", "correct the row")
    channels = {
        column.channel: np.array([_parse_cell(column, row[index], path, line) for line, row in lines])
        for index, column in enumerate(map(_COLUMN_BY_NAME.get, names))
        if column
    }
    return ReferenceTrace(
        name=path.stem, path=path, steps=_parse_steps(lines, names.index("time"), path), channels=channels
    )


def save_reference_trace(path: Path, trace: dict[str, np.ndarray]) -> None:
    """Write every fifth step of a recorded trace as a reference. Raises ConfigError if that fails."""
    channels = comparable_channels(trace)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", newline="", encoding="utf-8") as file:
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(("time", *(column.name for column in COLUMNS)))
            for step in range(0, len(trace["t"]), STEPS_PER_ROW):
                cells = (_render_cell(column, float(channels[column.channel][step])) for column in COLUMNS)
                rows.writerow((f"{step / STEPS_PER_SECOND:g}", *cells))
    except OSError as error:
        raise ConfigError(
            str(error.strerror),
            where=str(path),
            expected="a writable file",
            remedy="choose another --references",
        ) from None


def _parse_header(names: list[str], path: Path) -> list[str]:
    for name in names:
        if name not in _COLUMN_BY_NAME and name not in ("time", *IGNORED_COLUMNS):
            near = get_close_matches(name, _COLUMN_BY_NAME, n=1)
            remedy = f"did you mean {near[0]!r}?" if near else "remove it"
            _fail(path, 1, f"unknown column {name!r}", f"one of time, {', '.join(_COLUMN_BY_NAME)}", remedy)
        if names.count(name) > 1:
            _fail(path, 1, f"column {name!r} twice", "each column once", "remove one of them")
    if "time" not in names or not any(name in _COLUMN_BY_NAME for name in names):
        got = f"the header {','.join(names)[:60]!r}"
        _fail(path, 1, got, "`time` and at least one channel", "begin the file with its header")
    return names


def _parse_cell(column: TraceColumn, text: str, path: Path, line: int) -> float:
    if not text:
        return nan
    if text in column.value_names:
        return float(column.value_names.index(text))
    expected = (
        f"one of {', '.join(column.value_names)}" if column.value_names else "a finite number or nothing"
    )
    value = nan if column.value_names else _parse_number(text)
    if not isfinite(value):
        _fail(path, line, f"{column.name}: {text!r}", expected, "correct the cell")
    return value * column.si_factor


def _parse_steps(lines: list[tuple[int, list[str]]], time_index: int, path: Path) -> np.ndarray:
    steps: list[int] = []
    for line, row in lines:
        step = _parse_number(row[time_index]) * STEPS_PER_SECOND
        if not (isfinite(step) and step >= 0.0 and abs(step - round(step)) < 1e-6):
            _fail(path, line, f"time: {row[time_index]!r}", "a multiple of 0.01 s", "a step is 10 ms")
        if steps and round(step) <= steps[-1]:
            got = f"time: {row[time_index]} after {steps[-1] / STEPS_PER_SECOND:g}"
            _fail(path, line, got, "ascending times", "put the rows in order")
        steps.append(round(step))
    return np.array(steps)


def _parse_number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return nan


def _render_cell(column: TraceColumn, value: float) -> str:
    if not isfinite(value):
        return ""
    if column.value_names:
        return column.value_names[int(value)]
    return f"{value / column.si_factor:.6g}"


def _fail(path: Path, line: int, got: str, expected: str, remedy: str) -> NoReturn:
    raise ConfigError(got, where=str(path), line=line, expected=expected, remedy=remedy)
