"""The run folder: where a campaign keeps all it was told and all it found out.

DIR/
  run.json              schema, plan digest, choices, chunks, provenance (versions, source digests, seed)
  campaign.yaml         the campaign file as it was read
  plan.csv              the plan for people and spreadsheets
  plan/experiments.jsonl, plan/faults.jsonl      the frozen plan
  checks.json           the checks before the campaign, keyed by digest
  golden/<scenario>[+change]/trace.npz, record.json    fault-free runs
  patches/<xx>/<experiment>.patch                source diff of each experiment that ran
  records/<session>-<worker>.jsonl               one line per finished experiment, appended
  timings/<session>-<worker>.jsonl               CPU and wall time, host: what may differ between runs
  traces/<experiment>/                           on request (`rerun --trace`)
  results.csv, results.parquet, timings.parquet  derived; can be made again at any time
  owner.lock, workers.lock                       held by the running command and by its workers
  work/                                          scratch of running experiments
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class RunFolder:
    """Paths and head of a run folder."""

    path: Path

    @classmethod
    def open(cls, path: Path) -> "RunFolder":
        """An existing run folder; MutatorError when there is none, or one of a newer schema."""
        raise NotImplementedError

    @property
    def head(self) -> dict[str, Any]:
        """run.json."""
        raise NotImplementedError

    @property
    def provenance(self) -> dict[str, Any]:
        """Versions, source digests, seed."""
        raise NotImplementedError

    def golden(self, scenario: str, changes: tuple[str, ...] = ()) -> Path:
        """Folder with trace and record of the fault-free run."""
        raise NotImplementedError

    def patch(self, experiment_id: str) -> Path:
        """The source diff of an experiment (exists once it was run)."""
        raise NotImplementedError

    def find(self, prefix: str) -> str:
        """The one planned experiment whose id starts with `prefix`; MutatorError for none or several."""
        raise NotImplementedError


def clean(path: Path) -> None:
    """Delete a run folder; refused while a command or its workers hold it, or when it is no run folder."""
    raise NotImplementedError
