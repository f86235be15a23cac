"""Jobs that note where the statements of a counting mutant execute."""

from collections.abc import Mapping
from dataclasses import replace

from mutator.engines.engine_jobs import Job
from mutator.engines.in_target import reach_watch
from mutator.model import FaultLocation
from mutator.mutants.probe_contract import is_probe_path


def watched_job(job: Job, location_by_id: Mapping[str, FaultLocation]) -> Job:
    """Return the job of a counting mutant, with a probe that also notes calls in child processes."""
    places = tuple(dict.fromkeys((location.path, location.function) for location in location_by_id.values()))
    files = {
        path: data + _probe_addition(path) if is_probe_path(path) else data
        for path, data in job.changed_files.items()
    }
    return replace(job, changed_files=files, watched_places=places)


def _probe_addition(path: str) -> bytes:
    up = "/".join([".."] * len(path.split("/")))
    return reach_watch.PROBE_ADDITION.format(up=up, file=reach_watch.CHILD_FILE).encode()
