"""What tells the golden runs of jobs apart."""

from functools import cache
from pathlib import Path
from typing import NamedTuple

from mutator._common.hashing import content_id
from mutator.engines.engine_jobs import Job


class GoldenRunKey(NamedTuple):
    """What tells golden runs apart; `scenario_path` is absolute, without links."""

    scenario_path: str
    seed: int
    scenario_changes: tuple[str, ...]


def golden_run_key(job: Job) -> GoldenRunKey:
    return GoldenRunKey(resolved_path(job.scenario), job.seed, job.scenario_changes)


def golden_run_id(job: Job) -> str:
    return content_id(golden_run_key(job))


@cache
def resolved_path(scenario: Path) -> str:
    return str(scenario.resolve())
