"""Compile-time fault injection for driving controllers: from fault specs to verdicts.

The names of `__all__` are the public API, described in docs/reference/api.md; each is imported when it is
first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from mutator._common.version import VERSION

if TYPE_CHECKING:
    from mutator.api.campaigns import IncompleteRun, plan, run
    from mutator.api.comparisons import RunComparison, compare
    from mutator.api.experiment_results import TraceFrames
    from mutator.api.mutants import BuiltMutant, build_mutant
    from mutator.api.runs import Run, RunExperiment, load_run, merge_runs
    from mutator.api.trials import Trial, try_fault
    from mutator.campaigns.plans import Choices, Plan
    from mutator.comparison.comparison import Gate
    from mutator.errors import CheckFailed, MutatorError
    from mutator.execution.session import Summary
    from mutator.exports import Format
    from mutator.model import Experiment, Fault, Outcome, Record, Status, Trigger
    from mutator.store.records import Progress
    from mutator.workspace import Workspace

__version__ = VERSION

# module -> names; pandas, libcst and pytest are not paid for by who only wants the version
_HOMES = {
    "mutator.api.campaigns": ("IncompleteRun", "plan", "run"),
    "mutator.api.comparisons": ("RunComparison", "compare"),
    "mutator.api.experiment_results": ("TraceFrames",),
    "mutator.api.mutants": ("BuiltMutant", "build_mutant"),
    "mutator.api.runs": ("Run", "RunExperiment", "load_run", "merge_runs"),
    "mutator.api.trials": ("Trial", "try_fault"),
    "mutator.campaigns.plans": ("Choices", "Plan"),
    "mutator.comparison.comparison": ("Gate",),
    "mutator.errors": ("CheckFailed", "MutatorError"),
    "mutator.execution.session": ("Summary",),
    "mutator.exports": ("Format",),
    "mutator.model": ("Experiment", "Fault", "Outcome", "Record", "Status", "Trigger"),
    "mutator.store.records": ("Progress",),
    "mutator.workspace": ("Workspace",),
}
_LAZY = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "BuiltMutant",
    "CheckFailed",
    "Choices",
    "Experiment",
    "Fault",
    "Format",
    "Gate",
    "IncompleteRun",
    "MutatorError",
    "Outcome",
    "Plan",
    "Progress",
    "Record",
    "Run",
    "RunComparison",
    "RunExperiment",
    "Status",
    "Summary",
    "TraceFrames",
    "Trial",
    "Trigger",
    "Workspace",
    "__version__",
    "build_mutant",
    "compare",
    "load_run",
    "merge_runs",
    "plan",
    "run",
    "try_fault",
]


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = globals()[name] = getattr(import_module(_LAZY[name]), name)
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
