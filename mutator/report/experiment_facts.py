"""Data about all experiments that a report needs in addition to the results. It is read only once."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mutator._common.helper_processes import map_in_processes, process_count_for
from mutator.model import Experiment, Fault, Record
from mutator.outcomes.fault_paths import FaultPathFinder, UntimedPath, UntimedPathInputs
from mutator.outcomes.verdict_rules import was_active_at_hazard
from mutator.results.worst_first_ranking import worst_first_ranks
from mutator.statistics.event_time_statistics import FirstAlertsByHazardRun
from mutator.store.run_folder import RunFolder

if TYPE_CHECKING:
    from pandas import DataFrame

_EXPERIMENTS_IN_BATCH = (
    5_000  # enough to outweigh sending the results to another process, few enough for all cores
)
# extra columns of a frame of results; no metric has such a name
RANK_COLUMN, UNTIMED_PATH_COLUMN = "#place", "#untimed_path"
_TimedAlerts = tuple[tuple[str, float], ...]  # the alerts of one experiment
_BatchFacts = tuple[list[UntimedPathInputs | None], dict[str, _TimedAlerts], set[str]]


@dataclass(frozen=True, kw_only=True)
class ExperimentFacts:
    """`worst_first_ranks` (from 0) and `untimed_path_indices` (into `distinct_untimed_paths`, -1: none) have
    a number for each row of the results. `alerts_by_hazardous_id` has only experiments with a hazard, and
    `ids_active_at_hazard` those whose record shows that the fault still acted when the hazard came.
    `timings` has a row for each timed experiment; its engine is '' if not recorded.
    """

    worst_first_ranks: np.ndarray
    untimed_path_indices: np.ndarray
    distinct_untimed_paths: tuple[UntimedPath, ...]
    alerts_by_hazardous_id: FirstAlertsByHazardRun
    ids_active_at_hazard: frozenset[str]
    timings: "DataFrame"

    @classmethod
    def of(
        cls,
        folder: RunFolder,
        results: "DataFrame",
        experiments: Mapping[str, Experiment],
        records: Mapping[str, Record],
        faults: Mapping[str, Fault],
        fault_paths: FaultPathFinder | None,
    ) -> "ExperimentFacts":
        codes: dict[int, int] = {}  # compared by identity, because equal untimed paths are one object
        untimed_paths: list[UntimedPath] = []
        path_numbers = np.full(len(results), -1, dtype=np.int32)
        alerts: dict[str, _TimedAlerts] = {}
        ids_active_at_hazard: set[str] = set()
        for number, (all_inputs, batch_alerts, batch_active_ids) in enumerate(
            _path_inputs_and_hazards_by_batch(results, experiments, records, faults, fault_paths)
        ):
            alerts |= batch_alerts
            ids_active_at_hazard |= batch_active_ids
            for row, inputs in enumerate(all_inputs, start=number * _EXPERIMENTS_IN_BATCH):
                untimed_path = fault_paths.untimed_path_from(inputs) if fault_paths and inputs else None
                if untimed_path is not None:
                    path_numbers[row] = code = codes.setdefault(id(untimed_path), len(codes))
                    if code == len(untimed_paths):
                        untimed_paths.append(untimed_path)
        return cls(
            worst_first_ranks=worst_first_ranks(results),
            untimed_path_indices=path_numbers,
            distinct_untimed_paths=tuple(untimed_paths),
            alerts_by_hazardous_id=alerts,
            ids_active_at_hazard=frozenset(ids_active_at_hazard),
            timings=timings_frame(folder),
        )


def _path_inputs_and_hazards_by_batch(
    results: "DataFrame",
    experiments: Mapping[str, Experiment],
    records: Mapping[str, Record],
    faults: Mapping[str, Fault],
    fault_paths: FaultPathFinder | None,
) -> Iterator[_BatchFacts]:
    """Yield, for each batch of experiments, their `UntimedPathInputs`, the alerts of those with a hazard, and
    the ids of those whose fault provably still acted then.
    """
    pairs = results[["experiment_id", "fault_id"]]

    def inputs_and_hazards(piece: "DataFrame") -> _BatchFacts:
        all_inputs: list[UntimedPathInputs | None] = []
        alerts, active_ids = {}, set()
        for name, fault in zip(piece["experiment_id"], piece["fault_id"], strict=True):
            record, inputs = records.get(name), None
            if record is not None:
                if record.hazards:
                    alerts[name] = record.alerts
                    experiment = experiments.get(name)
                    if experiment and was_active_at_hazard(record, experiment):
                        active_ids.add(name)
                if fault_paths and fault in faults:
                    inputs = fault_paths.untimed_path_inputs(faults[fault], record)
            all_inputs.append(inputs)
        return all_inputs, alerts, active_ids

    batches = [
        pairs[begin : begin + _EXPERIMENTS_IN_BATCH] for begin in range(0, len(pairs), _EXPERIMENTS_IN_BATCH)
    ]
    return map_in_processes(inputs_and_hazards, batches, process_count_for(len(pairs)))


def timings_frame(folder: RunFolder) -> "DataFrame":
    import pandas as pd

    newest = folder.timings()
    rows = [
        (float(str(line["cpu_s"])), line["worker"], line["engine"], line["why"]) for line in newest.values()
    ]
    cpu_s, *words = zip(*rows, strict=True) if rows else ((), (), (), ())
    columns = dict(zip(("worker", "engine", "why"), map(pd.Categorical, words), strict=True))
    return pd.DataFrame({"experiment_id": list(newest), "cpu_s": np.array(cpu_s, dtype=float), **columns})
