"""Compile-time fault injection for driving controllers: from fault specs to verdicts.

The names in `__all__` are the public API. Each is imported on first use.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from mutator._common.version import VERSION

if TYPE_CHECKING:
    from mutator.api.audits import Audit, seal, verify
    from mutator.api.caches import cache_entries, cache_folder, clear_caches, prune_caches
    from mutator.api.campaigns import run
    from mutator.api.comparisons import RunComparison, compare, write_history
    from mutator.api.experiment_results import TraceFrames
    from mutator.api.libraries import (
        check_hazard_analysis,
        check_library,
        check_target,
        doctor,
        draw_control_structure,
        find_places,
        init_library,
    )
    from mutator.api.mutant_files import MutantSet
    from mutator.api.mutants import BuiltMutant, build_mutant
    from mutator.api.operator_mutants import OperatorChoice
    from mutator.api.plans import plan
    from mutator.api.reviews import ReviewedGroups, load_review
    from mutator.api.run_experiments import RunExperiment
    from mutator.api.runs import Run, load_run, merge_runs
    from mutator.api.trials import Trial, try_fault
    from mutator.audit.seal import Seals
    from mutator.campaigns.plans import Choices, Plan
    from mutator.comparison.comparison import Gate
    from mutator.errors import CheckFailed, IncompleteRun, MutatorError, MutatorWarning
    from mutator.execution.session import Summary
    from mutator.exports import Format
    from mutator.model import Experiment, Fault, Outcome, Record, Status, Trigger
    from mutator.report.film import Shot
    from mutator.report.history import History
    from mutator.store.progress import Progress
    from mutator.workspace import Workspace

__version__ = VERSION

# module -> names: `import mutator` stays fast because it does not load pandas, libcst or pytest
_HOMES = {
    "mutator.api.audits": ("Audit", "seal", "verify"),
    "mutator.api.caches": ("cache_entries", "cache_folder", "clear_caches", "prune_caches"),
    "mutator.api.campaigns": ("run",),
    "mutator.api.comparisons": ("RunComparison", "compare", "write_history"),
    "mutator.api.experiment_results": ("TraceFrames",),
    "mutator.api.libraries": (
        "check_hazard_analysis",
        "check_library",
        "check_target",
        "doctor",
        "draw_control_structure",
        "find_places",
        "init_library",
    ),
    "mutator.api.mutant_files": ("MutantSet",),
    "mutator.api.operator_mutants": ("OperatorChoice",),
    "mutator.api.mutants": ("BuiltMutant", "build_mutant"),
    "mutator.api.plans": ("plan",),
    "mutator.api.reviews": ("ReviewedGroups", "load_review"),
    "mutator.api.run_experiments": ("RunExperiment",),
    "mutator.api.runs": ("Run", "load_run", "merge_runs"),
    "mutator.api.trials": ("Trial", "try_fault"),
    "mutator.campaigns.plans": ("Choices", "Plan"),
    "mutator.comparison.comparison": ("Gate",),
    "mutator.errors": ("CheckFailed", "IncompleteRun", "MutatorError", "MutatorWarning"),
    "mutator.execution.session": ("Summary",),
    "mutator.exports": ("Format",),
    "mutator.model": ("Experiment", "Fault", "Outcome", "Record", "Status", "Trigger"),
    "mutator.report.film": ("Shot",),
    "mutator.report.history": ("History",),
    "mutator.store.progress": ("Progress",),
    "mutator.audit.seal": ("Seals",),
    "mutator.workspace": ("Workspace",),
}
_LAZY = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Audit",
    "BuiltMutant",
    "CheckFailed",
    "Choices",
    "Experiment",
    "Fault",
    "Format",
    "Gate",
    "History",
    "IncompleteRun",
    "MutantSet",
    "MutatorError",
    "MutatorWarning",
    "OperatorChoice",
    "Outcome",
    "Plan",
    "Progress",
    "Record",
    "ReviewedGroups",
    "Run",
    "RunComparison",
    "RunExperiment",
    "Seals",
    "Shot",
    "Status",
    "Summary",
    "TraceFrames",
    "Trial",
    "Trigger",
    "Workspace",
    "__version__",
    "build_mutant",
    "cache_entries",
    "cache_folder",
    "check_hazard_analysis",
    "check_library",
    "check_target",
    "clear_caches",
    "compare",
    "doctor",
    "draw_control_structure",
    "find_places",
    "init_library",
    "load_review",
    "load_run",
    "merge_runs",
    "plan",
    "prune_caches",
    "run",
    "seal",
    "try_fault",
    "verify",
    "write_history",
]


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = globals()[name] = getattr(import_module(_LAZY[name]), name)
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
