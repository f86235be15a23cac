"""One experiment outside a campaign, with everything kept: what `try`, `show` and `rerun --trace` need."""

from dataclasses import dataclass
from pathlib import Path

from mutator.campaign import Limits
from mutator.manifest import TargetManifest
from mutator.model import Experiment, Record
from mutator.mutant import Mutant
from mutator.workspace import Workspace


@dataclass(frozen=True, kw_only=True)
class Single:
    """An experiment run alone: `golden` and `faulty` are output folders (`golden.load_trace` reads them)."""

    experiment: Experiment
    mutant: Mutant | None  # None: the mutant does not compile (the record says so)
    record: Record
    golden: Path
    faulty: Path
    log: str


def run_single(
    workspace: Workspace,
    manifest: TargetManifest,
    experiment: Experiment,
    out: Path,
    *,
    limits: Limits | None = None,
    golden: Path | None = None,
) -> Single:
    """Run `experiment` into the folder `out` (made new inside it: golden/ unless given, faulty/, patch)."""
    raise NotImplementedError


def rerun(workspace: Workspace, run: Path, experiment_id: str) -> tuple[Single, bool]:
    """Run a planned experiment again with its trace kept in the run folder (traces/<id>/).

    The flag says whether the record equals the one of the campaign (true if there is none yet).
    """
    raise NotImplementedError
