"""Plans: the frozen, ordered list of a campaign's experiments, and what running them will take."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from mutator._common.arguments import check_type, check_whole
from mutator._common.hashing import digest, plain
from mutator._common.tables import Table
from mutator._common.text import counted
from mutator.campaigns.campaign_files import Campaign, check_readings, load_campaign, load_study
from mutator.campaigns.chunks import cut_runs
from mutator.campaigns.experiments import Expansion
from mutator.campaigns.filters import compile_filter
from mutator.campaigns.plan_warnings import warn_of_values
from mutator.campaigns.sampling import pick, pick_in_proportion, pick_pairs
from mutator.campaigns.shared_runs import in_turn, runs
from mutator.errors import MutatorError
from mutator.model import AfterHazard, Experiment
from mutator.outcomes.columns import PLAN_COLUMNS, plan_row
from mutator.store import plan_file
from mutator.store.check_results import measured_cpu_s
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN
from mutator.store.shards import Shard
from mutator.targets.stopping import stop_source
from mutator.workspace import Workspace

if TYPE_CHECKING:
    import pandas as pd

# First part of every plan digest. Digests are cited, so this text stays whatever becomes of the run schema.
_DIGEST_PREFIX = "run/1"
RUNS_PER_GOLDEN = 3  # golden twice and the null mutant, for each scenario and its changes
_DEFAULT_CPU_S = 1.4  # one run on the reference engine, interpreter start included
_START_S = 3.0  # of a campaign, before and after its runs
_BYTES_PER_EXPERIMENT = 9_000  # its series, patch, record and rows
_BYTES_PER_GOLDEN = 1_200_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Choices:
    """What was chosen on top of the campaign file; None: as the file says.

    `only` and `exclude` are filter expressions (`mutator.campaigns.filters`) over the columns known before
    running; `limit` keeps that many experiments, spread as a campaign's `sample` but guided and random ones
    in pairs; `shard` (`k/n`) is the share of the plan that its run folder will run; `series_mb` is the budget
    of its series, 0 for none.
    """

    seed: int | None = None
    reading: str | None = None
    only: str | None = None
    exclude: str | None = None
    limit: int | None = None
    shard: str | None = None
    series_mb: int | None = None

    def __post_init__(self) -> None:
        for name, least in (("seed", 0), ("limit", 1), ("series_mb", 0)):
            if (value := getattr(self, name)) is not None:
                check_whole(name, value, least=least)
        for name in ("reading", "only", "exclude", "shard"):
            if (value := getattr(self, name)) is not None:
                check_type(name, value, str, "text")
        if self.shard is not None:
            Shard.parse(self.shard)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """Expected cost of running a plan: one core's seconds, wall seconds on `workers`, bytes on disk.

    `measured` says whether the rate was measured (goldens of this run folder) or is a default.
    """

    cpu_s: float
    wall_s: float
    disk_bytes: int
    workers: int
    measured: bool


@dataclass(frozen=True, kw_only=True, repr=False)
class Plan:
    """Experiments in the order they are run, and how they are cut into chunks (lengths, in order).

    `runs` is how many runs they take: one that several scenarios have in common is run once.
    `run_cpu_s` is the measured CPU time of one run, if there is one.
    """

    campaign: Campaign
    choices: Choices
    seed: int
    reading: str
    experiments: tuple[Experiment, ...]
    chunks: tuple[int, ...]
    canary: Experiment
    runs: int
    digest: str  # same campaign, choices, library and scenarios: same digest on every machine
    run_cpu_s: float | None = None

    def __repr__(self) -> str:
        count = counted(len(self.experiments), "experiment")
        return f"<Plan of {self.campaign.name}, {self.reading}: {count}, seed {self.seed}>"

    def _repr_html_(self) -> str:
        groups = sorted(self.groups().items())
        rows = [(f"{module}/{kind}", method, str(n)) for (module, kind, method), n in groups]
        rows.append(("total", "", str(len(self.experiments))))
        table = Table(heads=("fault type", "method", "experiments"), rows=rows, right=(2,)).as_html()
        return f"<p>{escape(repr(self))}</p>{table}"

    def frame(self) -> "pd.DataFrame":
        """A pandas frame of the planned experiments: the columns of `rows`, by experiment id."""
        import pandas as pd

        return pd.DataFrame(self.rows()).set_index("experiment_id")

    def groups(self) -> Counter[tuple[str, str, str]]:
        """How many experiments there are of each (module, fault type, method)."""
        return Counter((e.fault.module, e.fault.fault_type, e.method.value) for e in self.experiments)

    def rows(self) -> list[dict[str, object]]:
        """One dict per experiment: the columns of the results table that are known before running."""
        return [plan_row(experiment) for experiment in self.experiments]

    def goldens(self) -> list[tuple[str, tuple[str, ...]]]:
        """(scenario, changes) of every fault-free run that is needed, the canary's included."""
        needed = dict.fromkeys((e.scenario, e.changes) for e in (*self.experiments, self.canary))
        return list(needed)

    def cost(self, workers: int = 2) -> Cost:
        """Expected time and disk of all of it."""
        goldens = len(self.goldens())
        runs = self.runs + RUNS_PER_GOLDEN * goldens + 1
        cpu_s = runs * (self.run_cpu_s or _DEFAULT_CPU_S)
        return Cost(
            cpu_s=cpu_s,
            wall_s=cpu_s / max(workers, 1) + _START_S,
            disk_bytes=len(self.experiments) * _BYTES_PER_EXPERIMENT + goldens * _BYTES_PER_GOLDEN,
            workers=workers,
            measured=self.run_cpu_s is not None,
        )


def make_plan(workspace: Workspace, campaign: str | Path, choices: Choices | None = None) -> Plan:
    """Expand a campaign (a name of the library or a file) into its plan; nothing is written or run.

    MutatorError for a choice that does not fit the campaign, and when no experiment is left; MutatorWarning
    for values that change nothing.
    """
    choices = Choices() if choices is None else choices
    check_type("choices", choices, Choices, "mutator.Choices")
    loaded = load_campaign(workspace.campaign(campaign))
    seed = loaded.seed if choices.seed is None else choices.seed
    readings = workspace.readings()
    check_readings(loaded, readings)
    load_study(loaded)
    reading = choices.reading or loaded.reading or readings.default
    if choices.reading is not None:
        readings.check(choices.reading)
    expansion = Expansion(workspace, loaded, workspace.manifest(loaded.target), seed, reading)
    if loaded.after_hazard is AfterHazard.STOP:
        stop_source(expansion.manifest)  # refused here, not by each run
    once = in_turn(runs(expansion.manifest, _choose(expansion.experiments(), loaded, choices, seed)))
    experiments = tuple(experiment for same in once for experiment in same)
    warn_of_values(experiments, workspace.fault_models())
    canary = expansion.canary()
    chunks = cut_runs(once, loaded.chunk)
    if choices.shard is not None and Shard.parse(choices.shard).of > len(chunks):
        raise MutatorError(
            choices.shard,
            argument="shard",
            expected=f"at most {len(chunks)} shards, one for each chunk of the plan",
            remedy="use fewer shards, or a smaller chunk in the campaign",
        )
    return Plan(
        campaign=loaded,
        choices=choices,
        seed=seed,
        reading=reading,
        experiments=experiments,
        chunks=chunks,
        canary=canary,
        digest=plan_digest([e.id for e in experiments], chunks, canary.id, loaded),
        runs=len(once),
    )


def plan_digest(ids: Sequence[str], chunks: Sequence[int], canary: str, campaign: Campaign) -> str:
    """The digest that follows from ids and chunks of the experiments, the canary's id, and the campaign."""
    content = [ids, chunks, canary, plain(campaign.canary), plain(campaign.limits)]
    return digest([_DIGEST_PREFIX, *content])


def _choose(
    experiments: tuple[Experiment, ...], campaign: Campaign, choices: Choices, seed: int
) -> tuple[Experiment, ...]:
    if campaign.sample is not None:
        experiments = _sample(experiments, campaign, campaign.sample, seed)
    for text, wanted in ((choices.only, True), (choices.exclude, False)):
        if text is not None:
            accepts = compile_filter(text, PLAN_COLUMNS)
            experiments = tuple(e for e in experiments if accepts(plan_row(e)) is wanted)
    if choices.limit is not None:
        experiments = pick_pairs(experiments, choices.limit, seed)
    if not experiments:
        raise MutatorError(
            "no experiment is left",
            where=campaign.path,
            argument="only",
            expected="at least one",
            remedy="widen `only`, `exclude` or the campaign's faults",
        )
    return experiments


def _sample(
    experiments: tuple[Experiment, ...], campaign: Campaign, count: int, seed: int
) -> tuple[Experiment, ...]:
    if not campaign.proportional:
        return pick(experiments, count, seed)
    try:
        return pick_in_proportion(experiments, count, seed)
    except ValueError as err:
        raise campaign.error(
            ("sample",), f"sample {count}", expected=str(err), remedy="correct the number"
        ) from None


def load_plan(folder: RunFolder) -> Plan:
    """The frozen plan of a run folder, complete (for reports; workers read single chunks instead)."""
    head = folder.head
    return Plan(
        campaign=load_campaign(folder.path / CAMPAIGN),
        choices=Choices(**{f.name: head["choices"].get(f.name) for f in fields(Choices)}),
        seed=head["seed"],
        reading=head["reading"],
        experiments=plan_file.read_all(folder.path),
        chunks=tuple(count for _, _, count in head["chunks"]),
        canary=folder.canary,
        runs=head.get("runs", head["experiments"]),
        digest=head["plan"],
        run_cpu_s=measured_cpu_s(folder),
    )
