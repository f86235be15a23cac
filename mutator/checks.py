"""The checks before a campaign: golden twice, null mutant, canary. Without them no campaign starts."""

from collections.abc import Callable
from dataclasses import dataclass

from mutator.plan import Plan
from mutator.records import Progress
from mutator.runfolder import RunFolder
from mutator.workspace import Workspace


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckResult:
    """One check: `golden S1`, `null mutant S1`, `canary`; `detail` says what was found."""

    name: str
    passed: bool
    detail: str
    cpu_s: float


def run_checks(
    workspace: Workspace,
    plan: Plan,
    folder: RunFolder,
    *,
    workers: int = 1,
    notify: Callable[[Progress], None] | None = None,
) -> tuple[CheckResult, ...]:
    """Run what is not yet known to pass for these very sources; results are kept in checks.json.

    CheckFailed (after all ran) when any fails. Also leaves the golden runs in the folder.
    """
    raise NotImplementedError
