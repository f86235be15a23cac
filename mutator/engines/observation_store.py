"""Stores what a probe observed in golden runs, for all workers of a session.

The null mutant of the checks before a campaign observes; without it, a worker's fork engine does.
"""

import hmac
import marshal
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.files import write_atomic
from mutator.engines.engine_jobs import JobResult
from mutator.engines.executed_functions import executed_functions_from_json
from mutator.engines.first_activation import GoldenObservations

OBSERVATION_KEYS = ("seen", "before", "libraries")  # of a watched run's report
_AUTHENTICATION_CODE_BYTES = 32  # of SHA-256


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
    """Observations of golden runs in files of `folder`.

    Mutants can write there, too, so a file counts only if whoever wrote it had the `secret`.
    """

    def __init__(self, folder: Path, secret: bytes) -> None:
        self._folder = folder
        self._secret = secret

    def load(self, golden_id: str) -> GoldenObservations | None:
        """Return the observations of a golden run; None if no engine with the same secret stored them."""
        path = self._path_of(golden_id)
        if not path.is_file():
            return None
        content = read_bounded(path)
        code, data = content[:_AUTHENTICATION_CODE_BYTES], content[_AUTHENTICATION_CODE_BYTES:]
        if not data or not hmac.compare_digest(code, self._authentication_code(path, data)):
            return None
        values, counts_before_steps, imported_modules, executed = marshal.loads(data)
        return GoldenObservations(
            values=values,
            counts_before_steps=counts_before_steps,
            imported_modules=imported_modules,
            executed_functions=executed_functions_from_json(executed),
        )

    def save(self, golden_id: str, observations: GoldenObservations) -> None:
        path = self._path_of(golden_id)
        executed = observations.executed_functions
        data = marshal.dumps(
            (
                observations.values,
                observations.counts_before_steps,
                observations.imported_modules,
                executed.as_json() if executed else None,
            )
        )
        write_atomic(path, self._authentication_code(path, data) + data)

    def remove(self, golden_id: str) -> None:
        self._path_of(golden_id).unlink(missing_ok=True)

    def _path_of(self, golden_id: str) -> Path:
        return self._folder / f"observed-{golden_id}"

    def _authentication_code(self, path: Path, data: bytes) -> bytes:
        return hmac.digest(self._secret, path.name.encode() + data, "sha256")
