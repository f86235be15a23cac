"""The run folder, which holds a campaign's inputs and results.

docs/reference/run-folder.md describes its files.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import Any

from mutator._common.bounded_reading import MOST_EXPERIMENT_DATA_BYTES, read_bounded
from mutator._common.confined_files import path_below
from mutator._common.files import check_path_encodable
from mutator._common.hashing import as_json_types
from mutator._common.library_and_run_folder_search import SCRATCH_FOLDER
from mutator._common.message_text import shortened_ids
from mutator.errors import MutatorError
from mutator.limits import Limits
from mutator.model import AfterHazard, Experiment, Record
from mutator.store import file_digests, integrity, plan_file
from mutator.store.allowed_contents import TRACES_FOLDER
from mutator.store.appended_files import unfinished_growth_problems
from mutator.store.checks_file import HazardTimes, golden_hazards_of_run, limits_of_run
from mutator.store.golden_files import GOLDEN_FOLDER, golden_output_folder
from mutator.store.golden_runs import GoldenRun
from mutator.store.packed_patches import PatchFolder
from mutator.store.plain_contents_check import check_plain_contents
from mutator.store.planned_scenarios import planned_scenarios_of
from mutator.store.records import load_records
from mutator.store.run_head import HEAD, RunHead, load_head
from mutator.store.session_environments import SessionEnvironment
from mutator.store.shards import Shard
from mutator.store.timings import load_timings
from mutator.targets.hazard_severity import SeverityScale

STOP_AFTER_FAULT_NOTE = (
    "Runs end at their first terminal hazard, or when their fault has been over for long enough: later "
    "hazards and alerts are not recorded."
)
STOP_AT_HAZARD_NOTE = "Runs end at their first terminal hazard: later hazards and alerts are not recorded."
DEFAULT_SERIES_BUDGET_MB = 500  # budget of a run's series, unless the plan sets another: some 80,000 of 6 kB
MOST_LISTED_IDS = 20  # experiments that an ambiguous id could mean
_MOST_READS = 3  # attempts to read a folder that its owner is writing


@dataclass(frozen=True)
class RunFolder:
    """The paths and the head of a run folder."""

    path: Path

    @classmethod
    def open(cls, path: Path) -> "RunFolder":
        """Open and verify an existing run folder.

        MutatorError if there is none, if it has another schema, if it contains links or the like
        (`check_plain_contents`), or if anything in it is damaged, missing or not in its plan.
        """
        folder = cls.open_unverified(path)
        for problem in folder.problems():
            raise problem
        return folder

    @classmethod
    def open_unverified(cls, path: Path) -> "RunFolder":
        """Like `open`, but without comparing the files with their digests."""
        if not cls.exists(path):
            raise MutatorError(
                "not a run folder (it has no run.json)",
                where=path,
                expected="a folder that `mutator plan` or `mutator run` made",
                remedy="check the path",
            )
        folder = cls(path.resolve())
        check_path_encodable(folder.path)
        check_plain_contents(folder.path)
        _ = folder.head  # read it here, so that a wrong schema fails early
        return folder

    @staticmethod
    def exists(path: Path) -> bool:
        return (path / HEAD).is_file()

    def problems(self, *, ignore_cache: bool = False) -> list[MutatorError]:
        """Return all differences from what was written.

        With `ignore_cache`, earlier verifications are ignored (`verified_runs_cache`).
        """
        for _ in range(_MOST_READS):
            try:
                ledger = file_digests.load_ledger(self.path)
            except MutatorError as err:
                return [err]
            problems = list(
                integrity.run_problems(self.path, self.head, ledger, self.shard, ignore_cache=ignore_cache)
            )
            # with another ledger than before, the owner wrote files while they were being compared
            if not problems or file_digests.load_ledger(self.path) == ledger:
                break
        return [*unfinished_growth_problems(self.path, ledger), *problems] if problems else []

    @property
    def is_finished(self) -> bool:
        """Whether every experiment has a final record, and the equivalence check is complete."""
        return file_digests.load_ledger(self.path).finished

    @cached_property
    def head(self) -> RunHead:
        return load_head(self.path)

    @property
    def provenance(self) -> dict[str, Any]:
        head = self.head
        return {
            "mutator": head.provenance.mutator,
            "stretches": as_json_types(head.stretches),
            "sources": as_json_types(head.sources),
            "seed": head.seed,
            **({"seeds": as_json_types(head.seeds)} if head.seeds else {}),
            "reading": head.reading,
        }

    @property
    def session_environments(self) -> tuple[SessionEnvironment, ...]:
        """The software and machine of each session that ran anything, oldest first."""
        return self.head.stretches

    def environment_of(self, experiment_id: str) -> SessionEnvironment | None:
        """Return the newest stretch of work that has a record of an experiment."""
        files = sorted((self.path / "records").glob("*.jsonl"))
        for environment in reversed(self.session_environments):
            for path in files:
                if fnmatchcase(path.stem, environment.records) and experiment_id.encode() in read_bounded(
                    path, MOST_EXPERIMENT_DATA_BYTES
                ):
                    return environment
        return None

    @property
    def planned_experiment_count(self) -> int:
        shard = self.shard
        if shard is None:
            return self.head.experiments
        return sum(count for i, (_, _, count) in enumerate(self.head.chunks) if shard.has_chunk(i))

    @property
    def shard(self) -> Shard | None:
        """The share of the plan that runs in this folder; None: all of it."""
        text = self.head.choices.shard
        return Shard.parse(text) if text else None

    @property
    def limits(self) -> Limits:
        """The limits of faulty runs: the campaign's, or those that the checks of this run measured."""
        return limits_of_run(self.path, self.head.limits)

    @property
    def golden_hazards(self) -> dict[str, HazardTimes]:
        """The hazards of each golden run that has some, by its key; none before its checks have passed."""
        return golden_hazards_of_run(self.path)

    @property
    def left_out_goldens(self) -> frozenset[str]:
        """The keys of golden runs whose experiments are left out."""
        return frozenset(self.golden_hazards if self.head.include is None else ())

    @property
    def severity_scale(self) -> SeverityScale | None:
        """The severity scale of the target; None without one."""
        return self.head.severity

    @property
    def is_bench(self) -> bool:
        """Whether the plan grew in batches, instead of following from a campaign."""
        return self.head.bench is not None

    @property
    def has_seeded_goldens(self) -> bool:
        """Whether the keys of golden runs contain the seed. In a bench, any seed can follow."""
        return self.is_bench or len(self.seeds) > 1

    @property
    def series_budget_mb(self) -> int:
        chosen = self.head.choices.series_mb
        return DEFAULT_SERIES_BUDGET_MB if chosen is None else chosen

    @property
    def has_alerts(self) -> bool:
        """Whether the target has alerts."""
        return bool(self.head.alerts)

    @property
    def early_end_note(self) -> str:
        if self.head.canary is not None:
            after_hazard = self.head.canary.get("after_hazard")
        else:  # all experiments of a plan have the same
            first = next(plan_file.iterate_experiments(self.path), None)
            after_hazard = first and first.after_hazard
        if after_hazard != AfterHazard.STOP:
            return ""
        planned = plan_file.iterate_experiments(self.path) if self.is_bench else iter(())
        return STOP_AFTER_FAULT_NOTE if any(e.end_s is not None for e in planned) else STOP_AT_HAZARD_NOTE

    @property
    def seeds(self) -> range:
        first, last = self.head.seeds or (self.head.seed, self.head.seed)
        return range(first, last + 1)

    @cached_property
    def golden_runs(self) -> tuple[GoldenRun, ...]:
        """All golden runs of the plan, those of concrete scenarios last."""
        planned = planned_scenarios_of(self.path)
        return (*self.listed_goldens, *(planned.golden_runs() if planned else ()))

    @property
    def goldens_with_files(self) -> tuple[GoldenRun, ...]:
        """The golden runs whose files the folder keeps: all, but for those of families if there is no
        experiment.
        """
        return self.golden_runs if self.head.experiments else self.listed_goldens

    @property
    def listed_goldens(self) -> tuple[GoldenRun, ...]:
        """The golden runs of the library's scenarios, which run.json lists."""
        return tuple(map(GoldenRun.from_stored, self.head.goldens))

    def golden_run_of(self, experiment: Experiment) -> GoldenRun:
        return GoldenRun.for_experiment(experiment, several_seeds=self.has_seeded_goldens)

    def golden_folder(self, scenario: str, changes: tuple[str, ...] = (), seed: int | None = None) -> Path:
        """Return a folder with the output of a golden run, for reading only. It is missing if the run is."""
        return golden_output_folder(self.path / GOLDEN_FOLDER, GoldenRun(scenario, changes, seed).key)

    def golden_folder_of(self, experiment: Experiment) -> Path:
        return self.golden_folder(*self.golden_run_of(experiment))

    def rerun_traces_folder(self, experiment_id: str) -> Path:
        """Return the folder of the traces that `rerun --trace` keeps."""
        return path_below(self.path / TRACES_FOLDER, experiment_id)

    @cached_property
    def patches(self) -> PatchFolder:
        return PatchFolder(self.path)

    def read_patch(self, experiment_id: str, record: Record | None) -> bytes | None:
        """Return the stored diff of an experiment with this record; None if it has not run, or had no mutant.

        MutatorError if the diff is missing or does not match the record.
        """
        if record is None or not record.patch:
            return None
        for problem in integrity.patch_problems(self.patches, experiment_id, record.patch):
            raise problem
        return self.patches.read_patch(experiment_id)

    def records(self, kind: str = "records") -> Mapping[str, Record]:
        """Return the records by experiment id, parsed on access; with kind `proof`, those of the proof."""
        return load_records(self.path, kind)

    def timings(self) -> Mapping[str, dict[str, Any]]:
        """Return the newest timing line of each experiment by id, parsed on access."""
        return load_timings(self.path)

    @property
    def canary(self) -> Experiment | None:
        """The experiment that must cause its hazard before the campaign starts; None without a canary."""
        if self.head.canary is None:
            return None
        return plan_file.canary_from_json(self.path / HEAD, self.head.canary)

    def planned_positions(self) -> dict[str, int]:
        return integrity.planned_positions(self.path, self.head, self.shard)

    @property
    def scratch_folder(self) -> Path:
        """Scratch folder. It can be deleted while no command owns the run folder."""
        return self.path / SCRATCH_FOLDER

    def experiment_ids(self) -> Iterator[str]:
        """Yield the ids of the planned experiments, in plan order, without reading the experiments."""
        return plan_file.experiment_ids(self.path)

    def experiment_id_from(self, prefix: str) -> str:
        """Return the only planned experiment whose id starts with `prefix`; MutatorError if not unique."""
        hits = [name for name in self.experiment_ids() if name.startswith(prefix)]
        if len(hits) == 1 and prefix:
            return hits[0]
        if not hits:
            raise MutatorError(
                f"no experiment '{prefix}'",
                where=self.path,
                expected="an id in plan.csv, or the beginning of exactly one",
                remedy="see plan.csv or results.csv",
            )
        more = f", and {len(hits) - MOST_LISTED_IDS} more" if len(hits) > MOST_LISTED_IDS else ""
        raise MutatorError(
            f"{len(hits)} experiments start with '{prefix}'",
            where=self.path,
            expected=f"one of {', '.join(shortened_ids(hits)[:MOST_LISTED_IDS])}{more}",
            remedy="give more of the id",
        )
