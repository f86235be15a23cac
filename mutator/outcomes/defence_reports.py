"""What the defences in a run's tree did, as the run reports it. Nothing in the report is trusted."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mutator._common.bounded_reading import MOST_JSON_BYTES, read_bounded
from mutator._common.confined_files import path_below
from mutator._common.hashing import parse_json
from mutator.errors import BadOutput
from mutator.model import DefenceActivity
from mutator.targets.manifest import DEFENCE_REPORT_FILE, TargetManifest

_KEYS = {"first", "last", "activations", "steps", "conflicts", "changes", "values"}
_COUNTS = ("activations", "steps", "conflicts")


def load_defence_activities(manifest: TargetManifest, out: Path) -> tuple[DefenceActivity, ...]:
    """Return what each defence did that acted in the run whose output is in `out`; none for a tree without
    defences. BadOutput if the report is missing or damaged.
    """
    if not manifest.defences:
        return ()
    commands = [command.name for command in manifest.actuation.commands] if manifest.actuation else []
    return load_activities([*manifest.defences], commands, out)


def load_activities(
    defences: Sequence[str], commands: Sequence[str], out: Path
) -> tuple[DefenceActivity, ...]:
    """Return what each of these defences did that acted in the run whose output is in `out`, in their order,
    which need not be that of the report. BadOutput if the report is missing or damaged, or if one has
    changed another command than `commands`.
    """
    path = path_below(out, DEFENCE_REPORT_FILE)
    try:
        report = parse_json(read_bounded(path, MOST_JSON_BYTES))
    except (OSError, ValueError):
        raise BadOutput("the run left no report of its defences", where=path) from None
    if not isinstance(report, dict) or report.keys() != {*defences}:
        raise _damage_error(path)
    activities = (_activity(name, report[name], commands, path) for name in defences)
    return tuple(activity for activity in activities if activity)


def _activity(name: str, entry: Any, commands: Sequence[str], path: Path) -> DefenceActivity | None:
    if not isinstance(entry, dict) or entry.keys() != _KEYS:
        raise _damage_error(path)
    counts = [entry[key] for key in _COUNTS]
    if not all(type(count) is int and count >= 0 for count in counts):
        raise _damage_error(path)
    times, changes, values = (entry["first"], entry["last"]), entry["changes"], entry["values"]
    if not entry["steps"]:
        return None
    is_sound = (
        all(map(_is_number, times))
        and times[0] <= times[1]
        and 0 < entry["activations"] <= entry["steps"]
        and isinstance(changes, dict)
        and isinstance(values, dict)
        and changes.keys() == values.keys() <= {*commands}
        and all(map(_is_number, (*changes.values(), *values.values())))
    )
    if not is_sound:
        raise _damage_error(path)
    return DefenceActivity(
        name=name,
        first=times[0],
        last=times[1],
        activations=entry["activations"],
        steps=entry["steps"],
        conflicts=entry["conflicts"],
        commands=tuple((c, changes[c], values[c]) for c in commands if c in changes),
    )


def _is_number(value: object) -> bool:
    return type(value) is float and math.isfinite(value)


def _damage_error(path: Path) -> BadOutput:
    return BadOutput("the report of its defences is damaged", where=path)
