"""The run folder: where a campaign keeps all it was told and all it found out.

DIR/
  run.json              schema, plan digest, choices, chunks, limits, canary, source digests, provenance
  campaign.yaml         the campaign file as it was read
  plan.csv              the plan for people and spreadsheets
  plan/experiments.jsonl, plan/faults.jsonl      the frozen plan
  reviewed.json         who approved what is run, and digests of it (`run --require-reviewed`)
  checks.json           the checks before the campaign, keyed by digest
  golden/<scenario>[+change]/                    fault-free runs: trace and record of the target
  patches/<xx>/<experiment>.patch                source diff of each experiment that ran
  records/<session>-<worker>.jsonl               one line per finished experiment, appended
  timings/<session>-<worker>.jsonl               CPU and wall time, host: what may differ between runs
  proof/<session>-<worker>.jsonl                 records of the sample run again on the reference engine
  traces/<experiment>/                           on request (`rerun --trace`)
  results.csv, results.parquet, timings.parquet  derived; can be made again at any time
  owner.lock, workers/                           held by the running command and by its workers
  work/                                          scratch of running experiments
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from mutator._common.files import check_is_text, read_json
from mutator.errors import MutatorError
from mutator.model import Limits
from mutator.store.plan_file import ids
from mutator.store.shards import Shard

SCHEMA = "run/1"
HEAD = "run.json"
SCRATCH = "work"
CONTENT = (  # all that may be in a run folder; * stands for any text, folders included
    *(HEAD, "campaign.yaml", "plan.csv", "plan/*.jsonl", "reviewed.json", "checks.json"),
    *("golden/*/*", "patches/*.patch", "records/*.jsonl", "timings/*.jsonl", "proof/*.jsonl"),
    *("traces/*/*", "plots/*", "results.csv", "results.parquet", "timings.parquet"),
    *("report/*.md", "report/*.html", "report/made_from.json", "report/series/*.js"),
    *("report/tables/*", "report/figures/*", "report/compare-*/*", "exports/*"),
    *("owner.lock", "workers/*", f"{SCRATCH}/*"),
)


def golden_key(scenario: str, changes: Sequence[str]) -> str:
    """Name of a golden run: `S1`, `S1+no_lead`."""
    return "+".join((scenario, *changes))


@dataclass(frozen=True)
class RunFolder:
    """Paths and head of a run folder."""

    path: Path

    @classmethod
    def open(cls, path: Path) -> "RunFolder":
        """An existing run folder; MutatorError when there is none, or one of a newer schema."""
        if not (path / HEAD).is_file():
            raise MutatorError(
                "no run folder (it has no run.json)",
                where=path,
                expected="a folder that `mutator plan` or `mutator run` made",
                remedy="check the path",
            )
        folder = cls(path.resolve())
        check_is_text(folder.path)
        _ = folder.head  # read now, so that a wrong schema is told now
        return folder

    @staticmethod
    def exists(path: Path) -> bool:
        """Whether there is a run folder at `path`."""
        return (path / HEAD).is_file()

    @cached_property
    def head(self) -> dict[str, Any]:
        """run.json."""
        return read_json(self.path / HEAD, SCHEMA)

    @property
    def provenance(self) -> dict[str, Any]:
        """Versions of mutator, Python and packages; source digests; seed and reading."""
        head = self.head
        found: dict[str, Any] = head["provenance"]
        return found | {key: head[key] for key in ("sources", "seed", "reading")}

    @property
    def planned(self) -> int:
        """Number of experiments planned for this folder: of its shard, or all."""
        shard = self.shard
        if shard is None:
            return int(self.head["experiments"])
        return sum(count for i, (_, _, count) in enumerate(self.head["chunks"]) if shard.has(i))

    @property
    def shard(self) -> Shard | None:
        """The share of the plan that is run here; None: all of it."""
        text = self.head["choices"].get("shard")  # runs of before there were shards do not say
        return Shard.parse(text) if text else None

    @property
    def limits(self) -> Limits:
        """Limits of each run."""
        return Limits(**self.head["limits"])

    def golden(self, scenario: str, changes: tuple[str, ...] = ()) -> Path:
        """Folder with trace and record of the fault-free run."""
        return self.path / "golden" / golden_key(scenario, changes)

    def patch(self, experiment_id: str) -> Path:
        """The source diff of an experiment (exists once it was run)."""
        return self.path / "patches" / experiment_id[:2] / f"{experiment_id}.patch"

    @property
    def work(self) -> Path:
        """Scratch; whatever is in it may be deleted while nobody owns the folder."""
        return self.path / SCRATCH

    @property
    def base(self) -> Path:
        """The pristine tree that runs are made from."""
        return self.work / "base"

    def find(self, prefix: str) -> str:
        """The one planned experiment whose id starts with `prefix`; MutatorError for none or several."""
        hits = [name for name in ids(self.path) if name.startswith(prefix)]
        if len(hits) != 1 or not prefix:
            got = f"{len(hits)} experiments start with '{prefix}'" if hits else f"no experiment '{prefix}'"
            raise MutatorError(
                got,
                where=self.path,
                expected="an id, or the beginning of just one, of plan.csv",
                remedy="give more of the id" if hits else "see plan.csv or results.csv",
            )
        return hits[0]
