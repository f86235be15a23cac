"""A plan: the frozen, ordered list of a campaign's experiments, and the expected cost of running them."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from html import escape
from itertools import chain
from operator import add
from pathlib import Path
from typing import TYPE_CHECKING

from mutator._common.argument_checks import check_type
from mutator._common.message_text import counted, describe_seeds
from mutator._common.table_rendering import TextTable
from mutator.campaigns.bench_files import load_campaign_of_run
from mutator.campaigns.campaign_expansion import CampaignExpansion
from mutator.campaigns.campaign_files import Campaign, check_expectation, check_readings, load_campaign
from mutator.campaigns.chunks import chunk_lengths_of_runs
from mutator.campaigns.experiment_choice import ExperimentChoice
from mutator.campaigns.fault_free_drives import FaultFreeDrive, check_choices_without_faults, drives_of_run
from mutator.campaigns.neutral_faults import NeutralFaultWarner
from mutator.campaigns.plan_tally import FaultTypeAndMethod, PlanPart, PlanTally, plan_digest
from mutator.campaigns.shared_runs import group_by_run, order_for_sharing
from mutator.errors import MutatorError
from mutator.families.family_facts import FamilyFacts
from mutator.limits import MeasuredLimits
from mutator.model import AfterHazard, Experiment
from mutator.results.plan_columns import columns_of_plan, plan_row
from mutator.store import plan_file
from mutator.store.golden_runs import GoldenRun
from mutator.store.plan_choices import Choices
from mutator.store.plan_strata import PlanStrata, load_strata
from mutator.store.preflight_results import mean_golden_run_cpu_s
from mutator.store.run_folder import RunFolder
from mutator.store.shards import Shard
from mutator.targets.early_stop_code import stop_function_source
from mutator.workspace import Workspace

if TYPE_CHECKING:
    import pandas as pd

CHECK_RUNS_PER_GOLDEN = 2  # golden run and null mutant, for each scenario with its changes
_BYTES_PER_DRIVE = 15_000  # the verdict and the scenario of a golden run whose trace is not kept
_DEFAULT_RUN_CPU_S = 1.4  # one run on the reference engine, including interpreter start
_TIME_OUTSIDE_RUNS_S = 3.0  # time that a campaign needs outside its runs
_BYTES_PER_EXPERIMENT = 9_000  # series, patch, record and table rows of an experiment
_BYTES_PER_GOLDEN = 1_200_000  # golden runs are stored as whole traces
_MOST_EXPERIMENTS_IN_MEMORY = 50_000  # larger plans are not read as a whole


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanCost:
    """The expected cost of a plan: CPU seconds, wall seconds on `workers`, bytes on disk."""

    cpu_s: float
    wall_s: float
    disk_bytes: int
    workers: int
    is_measured: bool  # whether `cpu_s` is based on golden runs of the run folder
    cpu_limit_s: int | None  # what a run that hangs costs; None: ten times its golden run, not measured yet


@dataclass(frozen=True, kw_only=True, repr=False)
class Plan:
    """Experiments in run order, cut into chunks."""

    campaign: Campaign  #: the campaign file as read
    choices: Choices  #: the options that override the file
    seed: int  #: the seed of the plan
    reading: str  #: the reading of the fault specs
    experiments: Sequence[Experiment]  #: the experiments in run order
    chunks: tuple[int, ...]  #: the number of experiments in each chunk, in order
    #: a fault that must cause its hazard; the checks before the campaign run it. None: the campaign has none
    canary: Experiment | None
    runs: int  #: the number of runs; a run that several scenarios share is counted once
    digest: str  #: the digest: equal on every machine for the same campaign, choices, library and scenarios
    run_cpu_s: float | None = None  #: the measured CPU time of one run in s; None: not measured
    #: the CPU time in s at which a run is cut off; None: it follows from golden runs that have not run yet
    cpu_limit_s: int | None = None
    operator_notes: tuple[str, ...] = ()  #: how many mutants the operators produced, and what was left out
    drives: tuple[FaultFreeDrive, ...] = ()  #: the runs of a campaign without faults
    families: tuple[FamilyFacts, ...] = ()  #: the families that gave scenarios
    strata: PlanStrata | None = None  #: of the plan from which the experiments were drawn; None: not drawn

    def __repr__(self) -> str:
        count = counted(len(self.experiments), "experiment")
        name = ", ".join(filter(None, (self.campaign.name, self.reading)))
        return f"<Plan of {name}: {count}, {describe_seeds(self.seeds)}>"

    @property
    def seeds(self) -> range:
        """All seeds of the plan."""
        return _selected_seeds(self.campaign, self.choices)

    @cached_property
    def tally(self) -> PlanTally:
        """The plan's totals."""
        tally = self.empty_tally()
        for part in self.parts():
            tally.add(part)
        return tally

    def empty_tally(self) -> PlanTally:
        """Return a tally without parts."""
        several = self.campaign.is_bench or len(self.seeds) > 1
        return PlanTally(canary=self.canary, has_several_seeds=several, drives=self.drives)

    def parts(self) -> Iterator[PlanPart]:
        """Yield the plan as one part."""
        yield PlanPart(
            experiments=self.experiments,
            chunk_lengths=self.chunks,
            run_count=self.runs,
            strata=self.strata,
        )

    def _repr_html_(self) -> str:
        groups = sorted(self.groups().items())
        rows = [(f"{module}/{kind}", method, str(n)) for (module, kind, method), n in groups]
        rows.append(("total", "", str(len(self.experiments))))
        table = TextTable(
            heads=("fault type", "method", "experiments"), rows=rows, right_aligned=(2,)
        ).as_html()
        return f"<p>{escape(repr(self))}</p>{table}"

    def frame(self) -> "pd.DataFrame":
        """Return the planned experiments as a pandas frame: `rows`, indexed by experiment id."""
        import pandas as pd

        return pd.DataFrame(self.rows()).set_index("experiment_id")

    def groups(self) -> Counter[FaultTypeAndMethod]:
        """Return the number of experiments for each (module, fault type, method)."""
        return self.tally.count_by_type_and_method

    def rows(self) -> list[dict[str, object]]:
        """Return one dict per experiment: the result columns that are known before it runs."""
        columns = columns_of_plan(self.families)
        return [plan_row(experiment, columns) for experiment in self.experiments]

    def goldens(self) -> tuple[GoldenRun, ...]:
        """Return every golden run that the plan needs, including that of a canary."""
        return self.tally.golden_runs()

    def cost(self, workers: int = 2) -> PlanCost:
        """Return the expected time and disk space."""
        goldens = len(self.goldens())
        listed = len(self.tally.listed_goldens)
        of_families = goldens - listed  # nearly all of them are driven once
        runs = self.runs + CHECK_RUNS_PER_GOLDEN * listed + of_families + bool(self.canary)
        bytes_per_family_run = _BYTES_PER_GOLDEN if self.experiments else _BYTES_PER_DRIVE
        bytes_of_goldens = listed * _BYTES_PER_GOLDEN + of_families * bytes_per_family_run
        cpu_s = runs * (self.run_cpu_s or _DEFAULT_RUN_CPU_S)
        return PlanCost(
            cpu_s=cpu_s,
            wall_s=cpu_s / max(workers, 1) + _TIME_OUTSIDE_RUNS_S,
            disk_bytes=len(self.experiments) * _BYTES_PER_EXPERIMENT + bytes_of_goldens,
            workers=workers,
            is_measured=self.run_cpu_s is not None,
            cpu_limit_s=self.cpu_limit_s,
        )


class SeedBySeedPlan:
    """A campaign with checked choices, expanded seed by seed.

    MutatorError for a choice that is invalid in this campaign.
    """

    def __init__(self, workspace: Workspace, campaign: str | Path, choices: Choices | None = None) -> None:
        self.choices = Choices() if choices is None else choices
        check_type("choices", self.choices, Choices, "mutator.Choices")
        self.campaign = load_campaign(workspace.campaign(campaign))
        if self.campaign.exploration_request is not None:
            raise self.campaign.error(
                ("explore",),
                f"campaign {self.campaign.name} explores, so results decide which experiments follow",
                expected="a campaign whose experiments can be planned",
                remedy="run it with `mutator run` or `mutator.run`",
            )
        self.seeds = _selected_seeds(self.campaign, self.choices)
        readings = workspace.readings()
        check_readings(self.campaign, readings)
        self.reading = self.choices.reading or self.campaign.reading or readings.default_name
        if self.choices.reading is not None:
            readings.check_name(self.choices.reading)
        self._workspace, self._manifest = workspace, workspace.manifest(self.campaign.target)
        if (expectation := self.campaign.expectation) is not None:
            scale, source = workspace.scale_of(self._manifest), self.campaign.yaml_source
            check_expectation(expectation, source, ("expect",), self._manifest.hazard_names, scale)
        for i, names in enumerate(self.campaign.defence_sets):
            with self.campaign.locating_errors(("defences", i)):
                workspace.defended(self._manifest, names)
        if self.campaign.is_fault_free:
            check_choices_without_faults(self.choices)
        if self.campaign.after_hazard is AfterHazard.STOP:
            stop_function_source(self._manifest)  # raises before any run starts
        self._expansion = CampaignExpansion(
            workspace, self.campaign, self._manifest, self.seeds[0], self.reading
        )
        self.canary = self._expansion.build_canary()

    @property
    def seed(self) -> int:
        return self.seeds[0]

    @property
    def operator_notes(self) -> tuple[str, ...]:
        """How many mutants the operators produced, and what was left out; known once the parts exist."""
        return self._expansion.operator_notes

    @property
    def families(self) -> tuple[FamilyFacts, ...]:
        """The families that give scenarios."""
        return self._expansion.scenarios.families

    def empty_tally(self) -> PlanTally:
        return PlanTally(canary=self.canary, has_several_seeds=len(self.seeds) > 1, drives=self.drives)

    @cached_property
    def drives(self) -> tuple[FaultFreeDrive, ...]:
        """The golden runs that a campaign without faults drives; none with faults."""
        if not self.campaign.is_fault_free:
            return ()
        return tuple(
            drive
            for seed in self.seeds
            for drive in self._expansion.with_seed(seed).fault_free_drives(several_seeds=len(self.seeds) > 1)
        )

    def parts(self) -> Iterator[PlanPart]:
        """Yield the experiments of each seed that has any.

        MutatorError if no seed has an experiment, or if there are more shards than chunks; MutatorWarning for
        values that change nothing.
        """
        neutral_faults, chunks = NeutralFaultWarner(self._workspace.fault_models()), 0
        limit = self.choices.limit
        for number, seed in enumerate(self.seeds):
            if limit == 0:
                break
            # an equal part of what remains, rounded up; what one seed lacks, the next ones get
            most_experiments = None if limit is None else -(-limit // (len(self.seeds) - number))
            part = self._build_part(seed, most_experiments)
            limit = None if limit is None else limit - len(part.experiments)
            chunks += len(part.chunk_lengths)
            neutral_faults.add(part.experiments)
            if part.experiments:
                yield part
        if not chunks and not self.campaign.is_fault_free:
            raise MutatorError(
                "no experiment is left",
                where=self.campaign.path,
                argument="only",
                expected="at least one",
                remedy="widen `only` or the campaign's faults, or narrow `exclude`",
            )
        self._check_shards(chunks)
        neutral_faults.warn()

    def _build_part(self, seed: int, most_experiments: int | None) -> PlanPart:
        experiments = self._expansion.with_seed(seed).build_experiments()
        choice = ExperimentChoice(campaign=self.campaign, choices=self.choices, families=self.families)
        chosen = choice.choose(experiments, seed, most_experiments)
        runs_in_order = order_for_sharing(group_by_run(self._manifest, chosen))
        return PlanPart(
            experiments=tuple(experiment for same in runs_in_order for experiment in same),
            chunk_lengths=chunk_lengths_of_runs(runs_in_order, self.campaign.chunk_size),
            run_count=len(runs_in_order),
            strata=choice.strata_before_draw(experiments, chosen),
        )

    def _check_shards(self, chunk_count: int) -> None:
        if self.choices.shard is not None and Shard.parse(self.choices.shard).shard_count > chunk_count:
            raise MutatorError(
                self.choices.shard,
                argument="shard",
                expected=f"at most {chunk_count}, because the plan has that many chunks",
                remedy="use fewer shards, or a smaller chunk in the campaign",
            )


def _selected_seeds(campaign: Campaign, choices: Choices) -> range:
    return campaign.seeds if choices.seed is None else range(choices.seed, choices.seed + 1)


def build_plan(workspace: Workspace, campaign: str | Path, choices: Choices | None = None) -> Plan:
    """Expand a campaign (a library name or a file) into its plan, without writing or running anything.

    MutatorError for an invalid choice, and if no experiment is left; MutatorWarning for values that change
    nothing.
    """
    planning = SeedBySeedPlan(workspace, campaign, choices)
    parts = tuple(planning.parts())
    experiments = tuple(chain.from_iterable(part.experiments for part in parts))
    chunks = tuple(chain.from_iterable(part.chunk_lengths for part in parts))
    canary, loaded = planning.canary, planning.campaign
    return Plan(
        campaign=loaded,
        choices=planning.choices,
        seed=planning.seed,
        reading=planning.reading,
        experiments=experiments,
        chunks=chunks,
        canary=canary,
        digest=plan_digest(
            [e.id for e in experiments], chunks, canary.id if canary else "", loaded, planning.drives
        ),
        drives=planning.drives,
        runs=sum(part.run_count for part in parts),
        cpu_limit_s=None if "cpu_s" in loaded.measured_limit_names else loaded.limits.cpu_s,
        operator_notes=planning.operator_notes,
        families=planning.families,
        strata=_sum_strata(part.strata for part in parts),
    )


def _sum_strata(strata: Iterable[PlanStrata | None]) -> PlanStrata | None:
    drawn = [each for each in strata if each]
    return reduce(add, drawn) if drawn else None


def load_plan(folder: RunFolder, tally: PlanTally | None = None) -> Plan:
    """Load the frozen plan of a run folder; `tally` has its totals, if known.

    The experiments of a very large plan are not kept in memory.
    """
    head = folder.head
    large = head.experiments > _MOST_EXPERIMENTS_IN_MEMORY
    campaign, limits = load_campaign_of_run(folder), folder.limits
    is_limit_known = isinstance(limits, MeasuredLimits) or "cpu_s" not in campaign.measured_limit_names
    plan = Plan(
        campaign=campaign,
        choices=head.choices,
        seed=head.seed,
        reading=head.reading,
        experiments=plan_file.ExperimentsReadOnAccess(folder.path, head.chunks)
        if large
        else plan_file.load_experiments(folder.path),
        chunks=tuple(count for _, _, count in head.chunks),
        canary=folder.canary,
        runs=head.runs,
        digest=head.plan,
        run_cpu_s=mean_golden_run_cpu_s(folder),
        cpu_limit_s=limits.cpu_s if is_limit_known else None,
        operator_notes=head.operators,
        drives=drives_of_run(folder) if campaign.is_fault_free else (),
        families=head.families,
        strata=load_strata(folder.path),
    )
    if tally is not None:
        vars(plan)["tally"] = tally  # set the cached property; computing it would read every experiment
    return plan
