"""The columns of results.csv that say what defences did. Only runs with defences in the target's tree have
them.
"""

from collections.abc import Sequence

from mutator.defences.defence import Role
from mutator.defences.defence_facts import DefenceFacts
from mutator.results.finished_experiments_and_columns import FinishedExperiment, ResultColumn, rounded_time

DEFENCE, FIRST_ACTED, ACTIVATIONS = "defence", "t_defence", "defence_activations"
CONFLICTS, DRIVER_AT_END = "defence_conflicts", "driver_at_end"
AFTER_FAULT, END_SPEED = "after_fault_s", "end_speed"
AUTHORITY_PREFIX = "authority_"  # of a column for each command of the defences
_TIME_TOLERANCE_S = 1e-6


def defence_columns(defences: Sequence[DefenceFacts]) -> tuple[ResultColumn, ...]:
    """Return the columns of a run with these defences; none without any."""
    if not defences:
        return ()
    commands = dict.fromkeys(command for defence in defences for command in defence.commands)
    drivers = frozenset(defence.name for defence in defences if defence.role is Role.DRIVER)
    return (
        *COLUMNS_OF_EVERY_DEFENCE,
        *map(_authority_column, commands),
        ResultColumn(
            DRIVER_AT_END,
            "flag",
            "",
            "whether a defence with the role `driver` acted in the last step",
            lambda f: _acts_at_end(f, drivers),
        ),
    )


def _authority_column(command: str) -> ResultColumn:
    def cell_of(finished: FinishedExperiment) -> float | None:
        values = (
            value
            for activity in finished.record.defences
            for name, _, value in activity.commands
            if name == command
        )
        return max(values, key=abs, default=None)

    about = f"the value furthest from 0 of `{command}` that a defence commanded, in the command's unit"
    return ResultColumn(f"{AUTHORITY_PREFIX}{command}", "number", "as the command", about, cell_of)


def _time_after_fault(finished: FinishedExperiment) -> float | None:
    record = finished.record
    if record.activation is None or record.run_end is None:
        return None
    return rounded_time(record.run_end.t - record.activation.last)


def _acts_at_end(finished: FinishedExperiment, names: frozenset[str]) -> int | None:
    end = finished.record.run_end
    if end is None:
        return None
    latest = (activity.last for activity in finished.record.defences if activity.name in names)
    return int(any(last >= end.t - _TIME_TOLERANCE_S for last in latest))


COLUMNS_OF_EVERY_DEFENCE = (
    ResultColumn(
        DEFENCE,
        "text",
        "",
        "names of the defences that acted, joined by `;`; only in runs with defences, like the columns "
        "that follow",
        lambda f: ";".join(activity.name for activity in f.record.defences) or None,
    ),
    ResultColumn(
        FIRST_ACTED,
        "number",
        "s",
        "when a defence first acted",
        lambda f: rounded_time(min((a.first for a in f.record.defences), default=None)),
    ),
    ResultColumn(
        ACTIVATIONS,
        "count",
        "",
        "number of activations of the defences",
        lambda f: sum(a.activations for a in f.record.defences) if f.is_ok else None,
    ),
    ResultColumn(
        CONFLICTS,
        "count",
        "",
        "number of steps in which a defence's range for a command and another one's did not overlap; of more "
        "than two defences, the number of the one with the most",
        # both defences count the step
        lambda f: max((a.conflicts for a in f.record.defences), default=0) if f.is_ok else None,
    ),
    ResultColumn(
        AFTER_FAULT,
        "number",
        "s",
        "time from the last step in which the fault was active to the end of the drive",
        _time_after_fault,
    ),
    ResultColumn(
        END_SPEED,
        "number",
        "m/s",
        "speed of the car at the end of the drive",
        lambda f: f.record.run_end.speed if f.record.run_end else None,
    ),
)
