"""What a report needs to know of all experiments beyond their results: read once, kept in columns."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mutator.model import Record
from mutator.outcomes.paths import Course, Ways
from mutator.outcomes.ranking import places
from mutator.statistics.times import Alerts
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder

if TYPE_CHECKING:
    from pandas import DataFrame

PLACE, COURSE = "#place", "#course"  # columns that a frame of results gets; no metric has such a name


@dataclass(frozen=True, kw_only=True)
class Seen:
    """`places` (among the worst, from 0) and `courses_of` (the place in `courses`, -1: none) have a number
    for each row of the results. `alerts` are those of the experiments with a hazard; `timings` has a row for
    each that has been timed: its id, CPU time, worker, engine ('' where it was not told) and why."""

    places: np.ndarray
    courses_of: np.ndarray
    courses: tuple[Course, ...]
    alerts: Alerts
    timings: "DataFrame"

    @classmethod
    def of(
        cls, folder: RunFolder, texts: "DataFrame", records: Mapping[str, Record], ways: Ways | None
    ) -> "Seen":
        """Of a run folder with these results."""
        faults = plan_file.read_faults(folder.path)
        codes: dict[int, int] = {}  # of courses, which are the same objects for all that have them
        courses: list[Course] = []
        courses_of = np.full(len(texts), -1, dtype=np.int32)
        alerts: dict[str, tuple[tuple[str, float], ...]] = {}
        for row, (name, fault) in enumerate(zip(texts["experiment_id"], texts["fault_id"], strict=True)):
            if name not in records:
                continue
            record = records[name]
            if record.hazards:
                alerts[name] = record.alerts
            course = ways.course(faults[fault], record) if ways and fault in faults else None
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


def timings_of(folder: RunFolder) -> "DataFrame":
    """`Seen.timings` of a run folder."""
    import pandas as pd

    newest = folder.timings()
    told = [
        (float(str(line["cpu_s"])), line["worker"], line.get("engine", ""), line.get("why", ""))
        for line in newest.values()
    ]
    cpu_s, *words = zip(*told, strict=True) if told else ((), (), (), ())
    columns = dict(zip(("worker", "engine", "why"), map(pd.Categorical, words), strict=True))
    return pd.DataFrame({"experiment_id": list(newest), "cpu_s": np.array(cpu_s, dtype=float), **columns})
