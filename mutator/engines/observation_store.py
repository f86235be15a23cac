"""Stores what a probe observed in golden runs, for all workers of a session.

The null mutant of the checks before a campaign observes; without it, a worker's fork engine does.
"""

import marshal
from pathlib import Path

from mutator.engines.authenticated_files import AuthenticatedFiles
from mutator.engines.engine_jobs import JobResult
from mutator.engines.executed_functions import executed_functions_from_json
from mutator.engines.first_activation import GoldenObservations

OBSERVATION_KEYS = ("seen", "before", "libraries")  # of a watched run's report


def observations_of_watched_run(result: JobResult) -> GoldenObservations:
    """Return what a null mutant observed that was driven step by step."""
    values, counts_before_steps, imported_modules = (result.watch_report[key] for key in OBSERVATION_KEYS)
    return GoldenObservations(
        values=tuple(map(tuple, values)),
        counts_before_steps=tuple(counts_before_steps),
        imported_modules=tuple(imported_modules),
        executed_functions=result.executed_functions,
    )


class ObservationStore:
    """Observations of golden runs in files of `folder` that count only with the right `secret`."""

    def __init__(self, folder: Path, secret: bytes) -> None:
        self._folder = folder
        self._files = AuthenticatedFiles(folder, secret)

    def load(self, golden_id: str) -> GoldenObservations | None:
        """Return the observations of a golden run; None if no engine with the same secret stored them."""
        data = self._files.load(_file_name(golden_id))
        if data is None:
            return None
        values, counts_before_steps, imported_modules, executed = marshal.loads(data)
        return GoldenObservations(
            values=values,
            counts_before_steps=counts_before_steps,
            imported_modules=imported_modules,
            executed_functions=executed_functions_from_json(executed),
        )

    def save(self, golden_id: str, observations: GoldenObservations) -> None:
        executed = observations.executed_functions
        data = marshal.dumps(
            (
                observations.values,
                observations.counts_before_steps,
                observations.imported_modules,
                executed.as_json() if executed else None,
            )
        )
        self._files.save(_file_name(golden_id), data)

    def remove(self, golden_id: str) -> None:
        (self._folder / _file_name(golden_id)).unlink(missing_ok=True)


def _file_name(golden_id: str) -> str:
    return f"observed-{golden_id}"
