"""Data about all experiments that a report needs in addition to the results. It is read only once."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mutator._common.processes import processes_for, shared
from mutator.model import Record
from mutator.outcomes.fault_paths import Course, Sight, Ways
from mutator.results.ranking import places
from mutator.statistics.times import Alerts
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder

if TYPE_CHECKING:
    from pandas import DataFrame

_PIECE = 5_000  # number of experiments in a batch
PLACE, COURSE = "#place", "#course"  # extra columns of a frame of results; no metric has such a name
_Alerts = tuple[tuple[str, float], ...]  # the alerts of one experiment


@dataclass(frozen=True, kw_only=True)
class Seen:
    """`places` (the rank, from 0) and `courses_of` (an index into `courses`, -1: none) have a number for
    each row of the results. `alerts` are those of experiments with a hazard. `timings` has a row for each
    timed experiment; its engine is '' if not recorded.
    """

    places: np.ndarray
    courses_of: np.ndarray
    courses: tuple[Course, ...]
    alerts: Alerts
    timings: "DataFrame"

    @classmethod
    def of(
        cls, folder: RunFolder, texts: "DataFrame", records: Mapping[str, Record], ways: Ways | None
    ) -> "Seen":
        codes: dict[int, int] = {}  # compared by identity, because equal courses are one object
        courses: list[Course] = []
        courses_of = np.full(len(texts), -1, dtype=np.int32)
        alerts: dict[str, _Alerts] = {}
        for number, (sights, told) in enumerate(_looks(folder, texts, records, ways)):
            alerts |= told
            for row, sight in enumerate(sights, start=number * _PIECE):
                course = ways.course_of(sight) if ways and sight else None
                if course is not None:
                    courses_of[row] = code = codes.setdefault(id(course), len(codes))
                    if code == len(courses):
                        courses.append(course)
        return cls(
            places=places(texts),
            courses_of=courses_of,
            courses=tuple(courses),
            alerts=alerts,
            timings=timings_of(folder),
        )


def _looks(
    folder: RunFolder, texts: "DataFrame", records: Mapping[str, Record], ways: Ways | None
) -> Iterator[tuple[list[Sight | None], dict[str, _Alerts]]]:
    """Yield, for each batch of experiments, their `Sight`, and the alerts of those with a hazard."""
    faults, pairs = plan_file.read_faults(folder.path), texts[["experiment_id", "fault_id"]]

    def looked_at(piece: "DataFrame") -> tuple[list[Sight | None], dict[str, _Alerts]]:
        sights: list[Sight | None] = []
        alerts = {}
        for name, fault in zip(piece["experiment_id"], piece["fault_id"], strict=True):
            record, sight = records.get(name), None
            if record is not None:
                if record.hazards:
                    alerts[name] = record.alerts
                if ways and fault in faults:
                    sight = ways.sight(faults[fault], record)
            sights.append(sight)
        return sights, alerts

    pieces = [pairs[begin : begin + _PIECE] for begin in range(0, len(pairs), _PIECE)]
    return shared(looked_at, pieces, processes_for(len(pairs)))


def timings_of(folder: RunFolder) -> "DataFrame":
    import pandas as pd

    newest = folder.timings()
    told = [
        (float(str(line["cpu_s"])), line["worker"], line.get("engine", ""), line.get("why", ""))
        for line in newest.values()
    ]
    cpu_s, *words = zip(*told, strict=True) if told else ((), (), (), ())
    columns = dict(zip(("worker", "engine", "why"), map(pd.Categorical, words), strict=True))
    return pd.DataFrame({"experiment_id": list(newest), "cpu_s": np.array(cpu_s, dtype=float), **columns})
