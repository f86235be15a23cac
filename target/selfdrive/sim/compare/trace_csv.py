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

STEPS_PER_SECOND = 100
ROW_STEPS = 5  # steps between written rows

_FCW_BIT = 1 << COUNTED_ALERTS.index("fcw")


class Column(NamedTuple):
    """One column. `factor` converts its numbers to SI; a column with `words` has these instead of numbers."""

    name: str
    channel: str
    unit: str = "-"
    factor: float = 1.0
    words: tuple[str, ...] = ()
    published: bool = False  # from a controller message, visible up to a control cycle later

    @property
    def exclusive(self) -> bool:
        return self.channel in ("engaged", "fcw", "lead_status") or bool(self.words)


COLUMNS = (
    Column("speed", "v_ego", "m/s"),
    Column("acceleration", "a_ego", "m/s2"),
    Column("speed_lead", "v_lead", "m/s"),
    Column("d_rel", "d_rel", "m"),
    Column("v_rel", "v_rel", "m/s"),
    Column("gas", "gas"),
    Column("brake", "brake"),
    Column("steer_torque", "steer_torque"),
    Column("angle_steer", "steer_angle", "rad", radians(1.0)),
    Column("headway_time", "hwt", "s"),
    Column("fcw", "fcw", published=True),
    Column("enabled", "engaged", published=True),
    Column("long_state", "long_state", words=LONG_STATES, published=True),
    Column("vEgo", "v_ego_est", "m/s", published=True),
    Column("aEgo", "a_ego_est", "m/s2", published=True),
    Column("vPid", "v_pid", "m/s", published=True),
    Column("vCruise", "v_cruise", "m/s", KPH_TO_MS, published=True),
    Column("plan_vTarget", "v_target", "m/s", published=True),
    Column("plan_aTarget", "a_target", "m/s2", published=True),
    Column("plan_source", "plan_source", words=PLAN_SOURCES, published=True),
    Column("lead_status", "lead_status", published=True),
    Column("lead_dRel", "lead_d_rel", "m", published=True),
    Column("lead_vRel", "lead_v_rel", "m/s", published=True),
    Column("lead_vLeadK", "lead_v_lead_k", "m/s", published=True),
    Column("lead_aLeadK", "lead_a_lead_k", "m/s2", published=True),
    Column("cum_path", "lateral_offset", "m"),
)
BY_CHANNEL = {column.channel: column for column in COLUMNS}
UNCOMPARED = ("distance", "distance_lead", "alertText1", "alertText2")  # allowed in a file, but ignored

_BY_NAME = {column.name: column for column in COLUMNS}


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """A reference trace: `steps` (each row's step of 10 ms), `channels` (values in SI units, NaN where
    empty)."""

    name: str
    path: Path
    steps: np.ndarray
    channels: dict[str, np.ndarray]


def channels_of(trace: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The channels of a recorded trace as floats, with `fcw` extracted from the alert bits."""
    channels = {name: np.asarray(values, dtype=float) for name, values in trace.items()}
    channels["fcw"] = (np.asarray(trace["alert"], dtype=int) & _FCW_BIT > 0).astype(float)
    return channels


def read_reference(path: Path) -> Reference:
    """Read a reference. Raises ConfigError, with the line, if it is invalid."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:  # some files begin with a byte order mark
            rows = csv.reader(file)
            names = _header(next(rows, []), path)
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
        column.channel: np.array([_cell(column, row[at], path, line) for line, row in lines])
        for at, column in enumerate(map(_BY_NAME.get, names))
        if column
    }
    return Reference(
        name=path.stem, path=path, steps=_steps(lines, names.index("time"), path), channels=channels
    )


def write_reference(path: Path, trace: dict[str, np.ndarray]) -> None:
    """Write every fifth step of a recorded trace as a reference. Raises ConfigError if that fails."""
    channels = channels_of(trace)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", newline="", encoding="utf-8") as file:
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(("time", *(column.name for column in COLUMNS)))
            for step in range(0, len(trace["t"]), ROW_STEPS):
                cells = (_text(column, float(channels[column.channel][step])) for column in COLUMNS)
                rows.writerow((f"{step / STEPS_PER_SECOND:g}", *cells))
    except OSError as error:
        raise ConfigError(
            str(error.strerror),
            where=str(path),
            expected="a writable file",
            remedy="choose another --references",
        ) from None


def _header(names: list[str], path: Path) -> list[str]:
    for name in names:
        if name not in _BY_NAME and name not in ("time", *UNCOMPARED):
            near = get_close_matches(name, _BY_NAME, n=1)
            remedy = f"did you mean {near[0]!r}?" if near else "remove it"
            _fail(path, 1, f"unknown column {name!r}", f"one of time, {', '.join(_BY_NAME)}", remedy)
        if names.count(name) > 1:
            _fail(path, 1, f"column {name!r} twice", "each column once", "remove one of them")
    if "time" not in names or not any(name in _BY_NAME for name in names):
        got = f"the header {','.join(names)[:60]!r}"
        _fail(path, 1, got, "`time` and at least one channel", "begin the file with its header")
    return names


def _cell(column: Column, text: str, path: Path, line: int) -> float:
    if not text:
        return nan
    if text in column.words:
        return float(column.words.index(text))
    expected = f"one of {', '.join(column.words)}" if column.words else "a finite number or nothing"
    value = nan if column.words else _number(text)
    if not isfinite(value):
        _fail(path, line, f"{column.name}: {text!r}", expected, "correct the cell")
    return value * column.factor


def _steps(lines: list[tuple[int, list[str]]], at: int, path: Path) -> np.ndarray:
    steps: list[int] = []
    for line, row in lines:
        step = _number(row[at]) * STEPS_PER_SECOND
        if not (isfinite(step) and step >= 0.0 and abs(step - round(step)) < 1e-6):
            _fail(path, line, f"time: {row[at]!r}", "a multiple of 0.01 s", "a step is 10 ms")
        if steps and round(step) <= steps[-1]:
            got = f"time: {row[at]} after {steps[-1] / STEPS_PER_SECOND:g}"
            _fail(path, line, got, "ascending times", "put the rows in order")
        steps.append(round(step))
    return np.array(steps)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return nan


def _text(column: Column, value: float) -> str:
    if not isfinite(value):
        return ""
    if column.words:
        return column.words[int(value)]
    return f"{value / column.factor:.6g}"


def _fail(path: Path, line: int, got: str, expected: str, remedy: str) -> NoReturn:
    raise ConfigError(got, where=str(path), line=line, expected=expected, remedy=remedy)
