"""What golden runs of families came to: hazards, alerts, margins and time, in `checks.json`.

Their traces are kept only if there are experiments in their scenarios.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mutator._common.files import read_json
from mutator._common.hashing import as_json_types
from mutator._common.typed_json import typed_value_from_json
from mutator.errors import MutatorError, TypeMisfit
from mutator.store.checks_file import CHECKS_FILE, CHECKS_SCHEMA
from mutator.store.run_folder import RunFolder

GOLDEN_VERDICTS_KEY = "verdicts"  # in checks.json


@dataclass(frozen=True, slots=True, kw_only=True)
class GoldenVerdict:
    """The judgement of a golden run. Times are in s."""

    duration_s: float  #: how long it drove
    t_end: float | None  #: when a terminal hazard ended the drive
    hazards: tuple[tuple[str, float], ...]  #: name, first time
    alerts: tuple[tuple[str, float], ...]  #: name, time of every raise
    metrics: tuple[tuple[str, float], ...]  #: those of the manifest that have a value, and margins
    trace_digest: str = ""  #: only if the plan has several seeds, whose drives can be equal

    @property
    def driven_s(self) -> float:
        """The time until the end of the drive."""
        return self.duration_s if self.t_end is None else self.t_end


def golden_verdicts_as_json(verdicts: Mapping[str, GoldenVerdict]) -> dict[str, Any]:
    """Return what checks.json stores of verdicts, by the key of the golden run."""
    values = {key: as_json_types(verdict) for key, verdict in verdicts.items()}
    for verdict in values.values():
        if not verdict["trace_digest"]:
            del verdict["trace_digest"]
    return {GOLDEN_VERDICTS_KEY: values}


def load_golden_verdicts(folder: RunFolder) -> Mapping[str, GoldenVerdict]:
    """Return the verdicts that a run folder has, by the key of the golden run; none without families."""
    path = folder.path / CHECKS_FILE
    stored: Mapping[str, Any] = read_json(path, CHECKS_SCHEMA) if path.is_file() else {}
    try:
        verdicts = stored.get(GOLDEN_VERDICTS_KEY, {})
        if isinstance(verdicts, dict):
            verdicts = {
                key: {"trace_digest": "", **verdict} if isinstance(verdict, dict) else verdict
                for key, verdict in verdicts.items()
            }
        return typed_value_from_json(Mapping[str, GoldenVerdict], verdicts)  # type: ignore[type-abstract]
    except TypeMisfit as err:
        raise MutatorError(
            f"damaged at '{GOLDEN_VERDICTS_KEY}' ({err.got})",
            where=path,
            expected=err.expected,
            remedy="restore the file from a copy of the run folder",
        ) from None
