"""Builds rows of the results table."""

from collections.abc import Sequence

from mutator.model import Experiment, Record, Status
from mutator.outcomes.fault_paths import fault_paths_of
from mutator.outcomes.verdicts import reaction_time, severity_of, since_activation, since_manifestation
from mutator.results.column_facts import (
    deviation_columns,
    hazard_columns,
    plan_row,
    result_columns,
    severity_columns,
)
from mutator.store.run_folder import RunFolder
from mutator.targets.severity import Scale
from mutator.targets.target_facts import T_END

_TIME_DIGITS = 6  # decimals of a time in s: finer than any step, coarser than a double's precision


def row(
    experiment: Experiment,
    record: Record,
    hazards: Sequence[str],
    *,
    ends: bool = False,
    scale: Scale | None = None,
) -> dict[str, object]:
    """Return the cells of one row, by column name. Without a trace, the row has no largest differences.

    `hazards` are those that the target checks. `ends` says whether a hazard can end the drive. `scale`
    classifies delta-v. None is an empty cell. Flags are 0 or 1. Times are in simulated seconds.
    """
    cells = plan_row(experiment) | _verdict_cells(record, scale)
    ok, times = record.status is Status.OK, dict(record.hazards)
    for name in hazards:
        flag, time = hazard_columns(name)
        cells[flag.name] = int(name in times) if ok else None
        cells[time.name] = _time(times.get(name))
    columns = deviation_columns([name for name, _ in record.max_dev])
    cells |= {columns[name]: value for name, value in record.max_dev}
    if ends:
        driven = dict(record.max_dev) | dict(record.dev)
        cells |= {columns[name].removeprefix("max_"): value for name, value in driven.items()}
        cells[T_END] = _time(record.t_end)
    return cells | dict(record.metrics)


def _verdict_cells(record: Record, scale: Scale | None) -> dict[str, object]:
    activation = record.activation
    ok = record.status is Status.OK
    return {
        "status": record.status.value,
        "outcome": record.outcome.value if record.outcome else None,
        "activated": 1 if activation else (0 if ok else None),
        "t_activation": _time(activation.first) if activation else None,
        "activations": activation.count if activation else (0 if ok else None),
        "manifested": int(record.t_manifest is not None) if ok else None,
        "t_manifest": _time(record.t_manifest),
        "alerts": ";".join(name for name, _ in record.alerts) or None,
        "t_alert": _time(record.alerts[0][1]) if record.alerts else None,
        "reaction_time": _time(reaction_time(record.hazards, record.alerts)),
        "severity": severity_of(record, scale),
        "fault_tolerant_time": _time(since_activation(record)),
        "manifest_to_hazard": _time(since_manifestation(record)),
        "detail": record.detail or None,
    }


def _time(value: float | None) -> float | None:
    return None if value is None else round(value, _TIME_DIGITS)


class ResultRows:
    """The columns of a run's results.csv, and the cells of its rows."""

    def __init__(self, folder: RunFolder) -> None:
        head = folder.head
        self._hazards, self._scale, self._fault_paths = head["hazards"], folder.scale, fault_paths_of(head)
        self._ends = T_END in (metric.name for metric in head.metrics)
        self.columns = result_columns(
            *(head["hazards"], head["compared"], head.metrics, severity_columns(head)),
            paths=self._fault_paths is not None,
        )
        self._names = [column.name for column in self.columns]

    def cells(self, experiment: Experiment, record: Record) -> list[object]:
        made = row(experiment, record, self._hazards, ends=self._ends, scale=self._scale)
        untimed_path = self._fault_paths.untimed_path(experiment.fault, record) if self._fault_paths else None
        if untimed_path:
            made |= {
                "reached": untimed_path.reached or None,
                "stopped_at": ";".join(untimed_path.stopped_at) or None,
            }
        return list(map(made.get, self._names))
