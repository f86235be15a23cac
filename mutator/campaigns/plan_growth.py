"""The plan of a bench, which grows in batches. Its files are only appended to.

The digest goes on over the ids of all batches, whatever their borders. Borders and reasons are in
`plan/batches.jsonl`, whose lines name the digest of the line before.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from itertools import chain
from pathlib import Path
from typing import Any

from mutator._common.bounded_reading import MOST_LINE_BYTES, open_regular, read_bounded
from mutator._common.files import write_atomic
from mutator._common.hashing import as_json_types, canonical_json, digest
from mutator._common.version import VERSION
from mutator.campaigns.bench_files import EXPERIMENTS_PER_CHUNK
from mutator.campaigns.campaign_files import Campaign
from mutator.campaigns.phrase_collection import (
    UsedPhraseSources,
    context_key,
    phrases_of_campaign,
    phrases_of_contexts,
)
from mutator.campaigns.plan_freezing import PLAN_CSV, collect_target_facts, plan_csv_head, plan_csv_lines
from mutator.campaigns.plan_tally import PlanDigestBuilder, PlanPart, PlanTally
from mutator.campaigns.run_inputs import RunInputs
from mutator.campaigns.shared_runs import run_key
from mutator.families.family_facts import FamilyFacts
from mutator.model import Experiment
from mutator.results.plan_columns import PlanColumn, columns_of_plan
from mutator.results.table_columns import check_parameter_names
from mutator.store import file_digests, plan_file
from mutator.store.appended_files import AppendedFile
from mutator.store.file_digests import DigestLedger, FileDigest
from mutator.store.golden_runs import GoldenRun
from mutator.store.plan_choices import Choices
from mutator.store.plan_file import BATCHES_FILE, EXPERIMENTS_FILE, FAULTS_FILE
from mutator.store.plan_lines import read_plan_lines
from mutator.store.planned_scenarios import SCENARIOS_FILE, PlannedScenario, scenario_lines
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN_FILE, HEAD, RUN_SCHEMA, BenchFacts, Provenance, RunHead
from mutator.targets.manifest import TargetManifest
from mutator.targets.stored_phrases import Phrases
from mutator.workspace import Workspace

# the last one only if a family gave a scenario
APPENDED_FILES = (EXPERIMENTS_FILE, FAULTS_FILE, PLAN_CSV, BATCHES_FILE, SCENARIOS_FILE)


@dataclass(slots=True)
class BatchChain:
    """The lines of `plan/batches.jsonl`: number, experiments, reason, and the digest of the line before."""

    count: int = 0
    last_digest: str = ""

    def line_of_next(self, experiment_count: int, reason: str) -> bytes:
        values = {
            "batch": self.count + 1,
            "before": self.last_digest,
            "experiments": experiment_count,
            "reason": reason,
        }
        line = canonical_json(values).encode() + b"\n"
        self.count, self.last_digest = self.count + 1, sha256(line).hexdigest()
        return line


class GrowingPlan:
    """The plan of the bench in the run folder `out`, for the folder's owner."""

    def __init__(
        self,
        workspace: Workspace,
        manifest: TargetManifest,
        campaign: Campaign,
        canary: Experiment | None,
        out: Path,
    ) -> None:
        self.ids: set[str] = set()
        self.campaign, self.canary = campaign, canary
        self._workspace, self._manifest, self._run = workspace, manifest, out
        self._tally = PlanTally(canary=canary, has_several_seeds=True)
        self._digest_builder = PlanDigestBuilder()
        self._fault_ids: set[str] = set()
        self._run_keys: set[object] = set()
        self._seeds: tuple[int, int] | None = None
        self._used, self._triggers = UsedPhraseSources(), set[tuple[str, str]]()
        self._phrases: tuple[tuple[int, int, int], Phrases] | None = None  # with what they were made from
        self._scenario_digests: dict[str, str] = {}
        self._chunks: list[plan_file.Chunk] = []
        self._batches = BatchChain()
        self._head = self._first_head()
        if not RunFolder.exists(out):
            for name in APPENDED_FILES:  # what a killed command left
                (out / name).unlink(missing_ok=True)
        self._files = {name: AppendedFile(out, name) for name in APPENDED_FILES}
        if RunFolder.exists(out):
            self._read_existing()

    def read_again(self) -> "GrowingPlan":
        """Return the plan as it is in the run folder, after a batch that could not be added."""
        return GrowingPlan(self._workspace, self._manifest, self.campaign, self.canary, self._run)

    @property
    def origin(self) -> str:
        """The digest of the plan without any experiment."""
        return PlanDigestBuilder().finish((), self._canary_id, self.campaign)

    @property
    def golden_runs(self) -> tuple[GoldenRun, ...]:
        """The golden runs of the plan, with the canary's at the end unless an experiment has it."""
        return self._tally.golden_runs()

    def family_of(self, scenario: str) -> str | None:
        """Return the family that gave a planned scenario; None for one of the library."""
        concrete = self._tally.concrete_by_name.get(scenario)
        return concrete.family if concrete else None

    def golden_runs_with(self, experiments: Sequence[Experiment]) -> tuple[GoldenRun, ...]:
        """Return the golden runs that the plan has once these experiments are added."""
        of_batch = (GoldenRun.for_experiment(e, several_seeds=True) for e in experiments)
        return tuple(dict.fromkeys((*self.golden_runs, *of_batch)))

    def append(self, experiments: Sequence[Experiment], reason: str) -> RunFolder:
        """Add a batch of new experiments, and return the run folder as it is then.

        MutatorError if a family's parameter has the name of another column.
        """
        for name in {e.concrete.family for e in experiments if e.concrete} - {*self._tally.families}:
            check_parameter_names(self._manifest, self._workspace.family(name).facts)
        faults = {e.fault.id: e.fault for e in experiments if e.fault.id not in self._fault_ids}
        self._files[EXPERIMENTS_FILE].add(b"".join(map(plan_file.experiment_line, experiments)))
        self._files[FAULTS_FILE].add(b"".join(map(plan_file.fault_line, faults.values())))
        self._files[BATCHES_FILE].add(self._batches.line_of_next(len(experiments), reason))
        planned, columns_before = set(self._tally.golden_runs()), self._plan_columns() if self.ids else ()
        self._count(experiments)
        if self._plan_columns() == columns_before:
            self._files[PLAN_CSV].add(plan_csv_lines(experiments, columns_before))
        else:  # the first batch, or the first scenario of a family
            self._files[PLAN_CSV].replace(self._plan_csv(experiments))
        self._files[SCENARIOS_FILE].add(
            scenario_lines(
                PlannedScenario(scenario=scenario.scenario, goldens=goldens)
                for scenario in self._tally.planned_scenarios()
                if (goldens := tuple(run for run in scenario.goldens if run not in planned))
            )
        )
        self._write()
        return RunFolder(self._run.resolve())

    def _plan_columns(self) -> Sequence[PlanColumn]:
        return columns_of_plan(self._family_facts)

    def _plan_csv(self, new: Iterable[Experiment] = ()) -> bytes:
        """Return plan.csv of the experiments in the run folder and new ones."""
        stored = plan_file.iterate_experiments(self._run) if RunFolder.exists(self._run) else ()
        columns = self._plan_columns()
        return plan_csv_head(columns) + plan_csv_lines(chain(stored, new), columns)

    def _count(self, experiments: Sequence[Experiment]) -> None:
        """Add experiments to all that run.json says about the plan."""
        keys = [run_key(self._manifest, experiment) for experiment in experiments]
        new_keys = set(keys) - self._run_keys
        self._run_keys |= new_keys
        self._tally.add(PlanPart(experiments=experiments, chunk_lengths=(), run_count=len(new_keys)))
        self._digest_builder.add([experiment.id for experiment in experiments])
        self._used.add(experiment.fault for experiment in experiments)
        for experiment in experiments:
            self.ids.add(experiment.id)
            self._fault_ids.add(experiment.fault.id)
            self._triggers.add(context_key(experiment.trigger))
            first, last = self._seeds or (experiment.seed, experiment.seed)
            self._seeds = min(first, experiment.seed), max(last, experiment.seed)
            self._extend_chunks(len(plan_file.experiment_line(experiment)))

    def _extend_chunks(self, line_length: int) -> None:
        offset, length, count = self._chunks[-1] if self._chunks else (0, 0, EXPERIMENTS_PER_CHUNK)
        if count == EXPERIMENTS_PER_CHUNK:
            self._chunks.append((offset + length, line_length, 1))
        else:
            self._chunks[-1] = (offset, length + line_length, count + 1)

    def _write(self) -> None:
        head = self._current_head().file_bytes()
        files = [file for file in self._files.values() if file.digest.size or file.name != SCENARIOS_FILE]
        digests = {file.name: file.digest for file in files}
        digests[HEAD] = FileDigest.of_bytes(head)
        if RunFolder.exists(self._run):
            with file_digests.announcing_rewrites(self._run, digests, finished=False):
                for file in files:
                    file.write_added()
                write_atomic(self._run / HEAD, head)
            return
        plan_file.create_plan_folder(self._run)
        write_atomic(self._run / CAMPAIGN_FILE, self.campaign.file_bytes)
        for file in files:
            file.write_added()
        digests[CAMPAIGN_FILE] = FileDigest.of_bytes(self.campaign.file_bytes)
        file_digests.save_ledger(self._run, DigestLedger(files=digests))
        write_atomic(self._run / HEAD, head)  # last, because this file makes the folder a run folder

    def _read_existing(self) -> None:
        self._count(tuple(plan_file.iterate_experiments(self._run)))
        for line in read_plan_lines(self._run / BATCHES_FILE):
            self._batches.count += 1
            self._batches.last_digest = sha256(line).hexdigest()
        self._renew_plan_csv()

    def _renew_plan_csv(self) -> None:
        """Write plan.csv anew if a command was killed after it had replaced the file for a new family."""
        with open_regular(self._run / PLAN_CSV) as file:
            has_head = file.readline(MOST_LINE_BYTES) == plan_csv_head(self._plan_columns())
        if not has_head:
            file_digests.rewrite_file(self._run, PLAN_CSV, self._plan_csv())
            self._files[PLAN_CSV] = AppendedFile(self._run, PLAN_CSV)

    @property
    def _family_facts(self) -> tuple[FamilyFacts, ...]:
        return tuple(self._workspace.family(name).facts for name in self._tally.families)

    @property
    def _canary_id(self) -> str:
        return self.canary.id if self.canary else ""

    def _first_head(self) -> RunHead:
        campaign = self.campaign
        canary: dict[str, Any] | None = None
        if self.canary:
            canary = plan_file.experiment_as_json(self.canary) | {"fault": as_json_types(self.canary.fault)}
        origin = self.origin
        return RunHead(
            schema=RUN_SCHEMA,
            plan=origin,
            campaign=campaign.name,
            campaign_digest=digest(campaign.file_bytes),
            study=None,
            target=campaign.target,
            seed=campaign.seed,
            reading=campaign.reading or "",
            choices=Choices(),
            experiments=0,
            runs=0,
            limits=campaign.limits,
            include=campaign.include,
            bench=BenchFacts(origin=origin),
            **vars(collect_target_facts(self._workspace, self._manifest)),
            goldens=(),
            canary=canary,
            canary_hazard=campaign.canary.hazard if campaign.canary else None,
            sources=RunInputs.from_workspace(self._workspace, self._manifest, ()).digest_by_source(),
            provenance=Provenance(mutator=VERSION),
            stretches=(),
            chunks=(),
        )

    def _current_head(self) -> RunHead:
        goldens, scenarios = self._tally.listed_goldens, self._files[SCENARIOS_FILE].digest
        stored = RunFolder(self._run).head if RunFolder.exists(self._run) else self._head
        return replace(
            self._head,
            plan=self._digest_builder.finish((), self._canary_id, self.campaign),
            seeds=self._seeds,
            experiments=len(self.ids),
            runs=len(self._run_keys),
            phrases=self._current_phrases(),
            goldens=tuple(golden.to_stored() for golden in goldens),
            scenarios=scenarios.sha256 if scenarios.size else None,
            families=self._family_facts,
            sources=self._sources(),
            stretches=stored.stretches,
            chunks=tuple(self._chunks),
        )

    def _current_phrases(self) -> Phrases:
        """Return the phrases of all faults and contexts so far. Most batches have no new ones."""
        self._triggers &= self._contexts
        counts = len(self._used.variants), len(self._used.models), len(self._triggers)
        if self._phrases is None or self._phrases[0] != counts:
            phrases = phrases_of_campaign(
                self._workspace, self.campaign, self._manifest, self._head.reading, self._used
            )
            situations = phrases_of_contexts(self._workspace, self._triggers)
            self._phrases = counts, replace(phrases, situations=situations)
        return self._phrases[1]

    @cached_property
    def _contexts(self) -> frozenset[tuple[str, str]]:
        """Name and condition of each context in the library."""
        tables = map(self._workspace.context_table, self._workspace.context_tables)
        return frozenset((row.id, row.condition) for table in tables for row in table.rows)

    def _sources(self) -> Mapping[str, str]:
        scenarios = sorted({golden.scenario for golden in self._tally.listed_goldens})
        families = self._tally.families
        sources = [f"scenario {name}" for name in scenarios] + [f"family {name}" for name in families]
        for source in sources:
            if source not in self._scenario_digests:  # the bench refuses a batch if a file was edited
                kind, _, name = source.partition(" ")
                workspace = self._workspace
                file = workspace.scenario(name) if kind == "scenario" else workspace.family(name).path
                self._scenario_digests[source] = digest(read_bounded(file))
        return {**self._head.sources, **{source: self._scenario_digests[source] for source in sources}}
