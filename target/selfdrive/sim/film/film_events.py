"""Title, outcome and event times of the faulty run, read from the harness's JSON."""

import json
from dataclasses import dataclass
from pathlib import Path

from selfdrive.common.errors import ConfigError

SCHEMA = "film-events/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class TimelineMark:
    """An event at `t` (s): `kind` is trigger, manifest, alert or hazard."""

    kind: str
    t: float
    label: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmEvents:
    """Data on the faulty run. Times in s; `active_span` covers the fault's activations, if any.

    `hazard_names` are short names by id. The run can continue after `drive_end`.
    """

    title: str
    outcome: str
    active_span: tuple[float, float] | None
    marks: tuple[TimelineMark, ...]
    hazard_names: dict[str, str]
    drive_end: float | None = None


def load_film_events(path: Path) -> FilmEvents:
    """Read events from a JSON file. Raises ConfigError for any other file."""
    try:
        data = json.loads(path.read_text())
        if data["schema"] != SCHEMA:
            raise ValueError(f"schema {data['schema']}")
        return FilmEvents(
            title=data["title"],
            outcome=data["outcome"],
            active_span=tuple(data["active"]) if data["active"] else None,
            marks=tuple(TimelineMark(**mark) for mark in data["marks"]),
            hazard_names=data["names"],
            drive_end=data.get("end"),
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(
            f"unreadable ({error})", where=str(path), expected=f"a {SCHEMA} file", remedy="correct --events"
        ) from None
