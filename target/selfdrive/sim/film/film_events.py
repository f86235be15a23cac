"""Title, outcome and event times of the faulty run, read from the harness's JSON."""

import json
from dataclasses import dataclass
from pathlib import Path

from selfdrive.common.errors import ConfigError

SCHEMA = "film-events/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """An event at `t` (s): `kind` is trigger, manifest, alert or hazard."""

    kind: str
    t: float
    label: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Events:
    """Data on the faulty run. Times in s; `active` spans the fault's activations, if any.

    `names` are short hazard names by id. `end` is the end of the drive; the run can continue after it.
    """

    title: str
    outcome: str
    active: tuple[float, float] | None
    marks: tuple[Mark, ...]
    names: dict[str, str]
    end: float | None = None


def read_events(path: Path) -> Events:
    """Read events from a JSON file. Raises ConfigError for any other file."""
    try:
        data = json.loads(path.read_text())
        if data["schema"] != SCHEMA:
            raise ValueError(f"schema {data['schema']}")
        return Events(
            title=data["title"],
            outcome=data["outcome"],
            active=tuple(data["active"]) if data["active"] else None,
            marks=tuple(Mark(**mark) for mark in data["marks"]),
            names=data["names"],
            end=data.get("end"),
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(
            f"unreadable ({error})", where=str(path), expected=f"a {SCHEMA} file", remedy="correct --events"
        ) from None
