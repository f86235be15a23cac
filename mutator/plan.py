"""Plans: the frozen, ordered list of a campaign's experiments, and what running them will take."""

from dataclasses import dataclass
from pathlib import Path

from mutator.campaign import Campaign
from mutator.model import Experiment
from mutator.runfolder import RunFolder
from mutator.workspace import Workspace


@dataclass(frozen=True, slots=True, kw_only=True)
class Choices:
    """What the command line chose on top of the campaign file; None: as the file says."""

    seed: int | None = None
    reading: str | None = None
    only: str | None = None
    exclude: str | None = None
    limit: int | None = None


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


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Experiments in the order they are run, and how they are cut into chunks (lengths, in order)."""

    campaign: Campaign
    choices: Choices
    seed: int
    reading: str
    experiments: tuple[Experiment, ...]
    chunks: tuple[int, ...]
    digest: str  # same campaign, choices, library and scenarios: same digest on every machine

    def rows(self) -> list[dict[str, object]]:
        """One dict per experiment: the columns of the results table that are known before running."""
        raise NotImplementedError

    def cost(self, workers: int = 2) -> Cost:
        """Expected time and disk."""
        raise NotImplementedError


def make_plan(
    workspace: Workspace,
    campaign: str | Path,
    *,
    seed: int | None = None,
    reading: str | None = None,
    only: str | None = None,
    exclude: str | None = None,
    limit: int | None = None,
) -> Plan:
    """Expand a campaign (a name of the library or a file) into its plan; nothing is written or run.

    `only`/`exclude` are filter expressions (`mutator.filters`) over the columns known before running;
    `limit` keeps that many experiments, picked like a campaign's `sample`.
    """
    raise NotImplementedError


def freeze(plan: Plan, out: Path, workspace: Workspace) -> RunFolder:
    """Write the plan (and plan.csv) into the run folder `out`, made if missing.

    A folder that holds the same plan is left as it is; another plan, or other sources than it was frozen
    with, is a MutatorError.
    """
    raise NotImplementedError


def load_plan(out: Path) -> Plan:
    """The frozen plan of a run folder, complete (for reports; workers read single chunks instead)."""
    raise NotImplementedError
