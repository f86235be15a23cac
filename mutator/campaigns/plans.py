"""Plans: the frozen, ordered list of a campaign's experiments, and what running them will take."""

import csv
import io
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mutator._common.arguments import check_type, check_whole
from mutator._common.files import is_half_written, json_bytes, make_folder, write_atomic
from mutator._common.hashing import digest, plain
from mutator._common.locks import owned
from mutator._common.tables import Table
from mutator._common.text import counted
from mutator._common.version import VERSION
from mutator.campaigns.campaign_files import Campaign, check_readings, load_campaign, load_study
from mutator.campaigns.chunks import cut_runs
from mutator.campaigns.experiments import Expansion
from mutator.campaigns.filters import compile_filter
from mutator.campaigns.plan_warnings import warn_of_values
from mutator.campaigns.provenance import check_sources, check_version, sources
from mutator.campaigns.sampling import pick, pick_in_proportion, pick_pairs
from mutator.campaigns.shared_runs import in_turn, runs
from mutator.errors import MutatorError
from mutator.model import AfterHazard, Experiment
from mutator.outcomes.columns import PLAN_COLUMNS, metric_columns, plan_row
from mutator.outcomes.propagation import channel_facts
from mutator.store import digests, plan_file
from mutator.store.check_results import measured_cpu_s
from mutator.store.digests import Digest, Ledger
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import CAMPAIGN, HEAD, SCHEMA
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


def freeze(plan: Plan, out: Path, workspace: Workspace) -> RunFolder:
    """Write the plan (and plan.csv) into the run folder `out`, made if missing.

    A folder that holds the same plan is left as it is; another plan, or other sources than it was frozen
    with, is a MutatorError, as is a folder in use or one that holds other things.
    """
    make_run_folder(out)
    with owned(out):
        return freeze_owned(plan, out, workspace)


def make_run_folder(out: Path) -> None:
    """Make `out` unless it is a run folder; MutatorError when it holds anything else."""
    if out.exists() and not RunFolder.exists(out):
        names = [path.name for path in out.iterdir()] if out.is_dir() else [out.name]
        strangers = [name for name in names if name not in _OURS and not is_half_written(name)]
        if strangers:
            raise MutatorError(
                f"no {HEAD}, and not empty ({', '.join(sorted(strangers)[:3])})",
                where=out,
                argument="out",
                expected="a run folder, or a new or empty folder",
                remedy="choose another `out`",
            )
    make_folder(out)


CSV = "plan.csv"
_OURS = ("owner.lock", "workers", "plan", CSV, CAMPAIGN, digests.FILE)  # what a killed freeze leaves


def freeze_owned(plan: Plan, out: Path, workspace: Workspace) -> RunFolder:
    """As `freeze`, by who owns the folder already."""
    if RunFolder.exists(out):
        folder = RunFolder.open(out)
        if folder.head["plan"] != plan.digest:
            raise MutatorError(
                "holds another plan",
                where=out,
                expected=f"plan {plan.digest[:16]}",
                remedy="use another folder, or the campaign and options it was planned with",
            )
        check_version(out, folder.head["schema"], folder.head["provenance"])
        check_sources(out, folder.head["sources"], _sources(plan, workspace))
        return folder
    write_atomic(out / CAMPAIGN, plan.campaign.source)
    write_atomic(out / CSV, plan_csv(plan))
    chunks = plan_file.write(out, plan.experiments, plan.chunks)
    head = json_bytes(_head(plan, workspace, chunks))
    written = (CAMPAIGN, CSV, plan_file.EXPERIMENTS, plan_file.FAULTS)
    files = {name: Digest.of((out / name).read_bytes()) for name in written}
    digests.write(out, Ledger(files=files | {HEAD: Digest.of(head)}))
    write_atomic(out / HEAD, head)  # last: from now on it is a run folder
    return RunFolder.open(out)


def _sources(plan: Plan, workspace: Workspace) -> dict[str, str]:
    scenarios = {scenario for scenario, _ in plan.goldens()}
    return sources(workspace, workspace.manifest(plan.campaign.target), scenarios)


def _head(plan: Plan, workspace: Workspace, chunks: list[plan_file.Chunk]) -> dict[str, Any]:
    manifest = workspace.manifest(plan.campaign.target)
    structure = workspace.structure(manifest)
    canary = plan_file.to_plain(plan.canary) | {"fault": plain(plan.canary.fault)}
    return {
        "schema": SCHEMA,
        "plan": plan.digest,
        "campaign": plan.campaign.name,
        "campaign_digest": digest(plan.campaign.source),
        "study": plan.campaign.study,
        "target": plan.campaign.target,
        "seed": plan.seed,
        "reading": plan.reading,
        "choices": asdict(plan.choices),
        "experiments": len(plan.experiments),
        "runs": plan.runs,
        "limits": plain(plan.campaign.limits),
        "hazards": list(manifest.hazards),
        "alerts": list(manifest.alerts),
        "compared": [channel.name for channel in manifest.compared],
        "metrics": metric_columns(manifest),
        "about_hazards": [
            {"name": one.name, "about": one.about, "terminal": bool(one.terminal)} for one in manifest.rules
        ],
        "severity": scale.plain() if (scale := workspace.scale_of(manifest)) else None,
        "channels": channel_facts(manifest),
        "structure": structure.model_dump(mode="json", by_alias=True) if structure else None,
        "goldens": [[scenario, list(changes)] for scenario, changes in plan.goldens()],
        "golden_files": list(manifest.outputs),
        "canary": canary,
        "canary_hazard": plan.campaign.canary.hazard,
        "sources": _sources(plan, workspace),
        "target_files": manifest.tree.digests,
        "provenance": {"mutator": VERSION},
        "stretches": [],
        "chunks": chunks,
    }


def plan_csv(plan: Plan) -> bytes:
    """What plan.csv holds."""
    writer = csv.DictWriter(text := io.StringIO(), PLAN_COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(plan.rows())
    return text.getvalue().encode()


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
