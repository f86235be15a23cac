"""Plans in parts, one per seed, so that counting and hashing need only one part at a time."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from hashlib import sha256

from mutator._common.hashing import as_json_types, canonical_json
from mutator.campaigns.campaign_files import Campaign
from mutator.campaigns.fault_free_drives import FaultFreeDrive
from mutator.model import ConcreteScenario, Experiment, Fault
from mutator.store.golden_runs import GoldenRun
from mutator.store.plan_strata import PlanStrata
from mutator.store.planned_scenarios import PlannedScenario

# The start of every plan digest. Publications cite digests, so this text must never change.
_PLAN_DIGEST_PREFIX = "run/1"

FaultTypeAndMethod = tuple[str, str, str]  # module, fault type, method


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanPart:
    """Experiments in run order, the lengths of their chunks, and the number of runs; experiments can share
    a run.
    """

    experiments: Sequence[Experiment]
    chunk_lengths: Sequence[int]
    run_count: int
    strata: PlanStrata | None = None  # of the plan from which the experiments were drawn, if they were


@dataclass(slots=True, kw_only=True)
class PlanTally:
    """The totals of the plan parts added so far."""

    canary: Experiment | None
    has_several_seeds: bool  # each seed has its own golden runs
    drives: tuple[FaultFreeDrive, ...] = ()  # of a campaign without faults
    experiment_count: int = 0
    run_count: int = 0
    chunk_lengths: list[int] = field(default_factory=list)
    count_by_type_and_method: Counter[FaultTypeAndMethod] = field(default_factory=Counter)
    goldens_without_canary: dict[GoldenRun, None] = field(default_factory=dict)
    example_fault_by_variant: dict[str, Fault] = field(default_factory=dict)  # one fault per variant
    concrete_by_name: dict[str, ConcreteScenario] = field(default_factory=dict)  # scenarios of families
    strata: PlanStrata | None = None

    def __post_init__(self) -> None:
        for drive in self.drives:
            self.goldens_without_canary.setdefault(drive.golden_run)
            if drive.concrete is not None:
                self.concrete_by_name[drive.golden_run.scenario] = drive.concrete

    def add(self, part: PlanPart) -> None:
        self.experiment_count += len(part.experiments)
        self.run_count += part.run_count
        self.chunk_lengths += part.chunk_lengths
        if part.strata:
            self.strata = self.strata + part.strata if self.strata else part.strata
        for experiment in part.experiments:
            fault = experiment.fault
            self.count_by_type_and_method[fault.module, fault.fault_type, experiment.method.value] += 1
            self.goldens_without_canary.setdefault(
                GoldenRun.for_experiment(experiment, several_seeds=self.has_several_seeds)
            )
            self.example_fault_by_variant[fault.spec] = fault
            if experiment.concrete is not None:
                self.concrete_by_name[experiment.scenario] = experiment.concrete

    def golden_runs(self) -> tuple[GoldenRun, ...]:
        if self.canary is None:
            return tuple(self.goldens_without_canary)
        canary_golden = GoldenRun.for_experiment(self.canary, several_seeds=self.has_several_seeds)
        return tuple(dict.fromkeys((*self.goldens_without_canary, canary_golden)))

    @property
    def families(self) -> tuple[str, ...]:
        """The names of the families that gave scenarios, sorted."""
        return tuple(sorted({concrete.family for concrete in self.concrete_by_name.values()}))

    @property
    def listed_goldens(self) -> tuple[GoldenRun, ...]:
        """The golden runs of the library's scenarios."""
        return tuple(run for run in self.golden_runs() if run.scenario not in self.concrete_by_name)

    def planned_scenarios(self) -> tuple[PlannedScenario, ...]:
        """Return the scenarios of families, with their golden runs."""
        goldens: dict[str, list[GoldenRun]] = {name: [] for name in self.concrete_by_name}
        for golden in self.golden_runs():
            if golden.scenario in goldens:
                goldens[golden.scenario].append(golden)
        return tuple(
            PlannedScenario(scenario=scenario, goldens=tuple(goldens[name]))
            for name, scenario in self.concrete_by_name.items()
        )


class PlanDigestBuilder:
    """The digest of the ids and chunks of the experiments, the canary's id ('': none), and the campaign.

    A bench has no chunks, so its batches do not change the digest.
    """

    def __init__(self) -> None:
        # a JSON list, hashed as it grows, so that no plan has to be in memory as a whole
        self._hash = sha256(f"[{canonical_json(_PLAN_DIGEST_PREFIX)},[".encode())
        self._separator = ""

    def add(self, ids: Sequence[str]) -> None:
        if ids:
            self._hash.update((self._separator + ",".join(f'"{name}"' for name in ids)).encode())
            self._separator = ","

    def finish(
        self,
        chunk_lengths: Sequence[int],
        canary_id: str,
        campaign: Campaign,
        drives: Sequence[FaultFreeDrive] = (),
    ) -> str:
        # without its opening bracket, because it continues the list that began with the ids
        chunk_lengths = () if campaign.is_bench else chunk_lengths
        rest = [chunk_lengths, canary_id, as_json_types(campaign.canary), as_json_types(campaign.limits)]
        if drives:
            rest.append(sorted([drive.golden_run.key, drive.scenario_digest] for drive in drives))
        rest += [campaign.include] if campaign.include else []
        whole = self._hash.copy()  # a bench's plan can grow further
        whole.update(f"],{canonical_json(rest)[1:]}".encode())
        return whole.hexdigest()


def plan_digest(
    ids: Sequence[str],
    chunk_lengths: Sequence[int],
    canary_id: str,
    campaign: Campaign,
    drives: Sequence[FaultFreeDrive] = (),
) -> str:
    digest_builder = PlanDigestBuilder()
    digest_builder.add(ids)
    return digest_builder.finish(chunk_lengths, canary_id, campaign, drives)
