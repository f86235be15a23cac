"""Compile-time fault injection for driving controllers: from fault specs to verdicts.

The names in `__all__` are the public API. Each is imported on first use.
"""

from importlib import import_module
from typing import Any

from mutator._common.version import VERSION

__version__ = VERSION

# module -> names: `import mutator` stays fast because it does not load pandas, libcst or pytest.
# Type checkers read __init__.pyi, which `python -m mutator.reference` generates from these names.
NAMES_BY_MODULE = {
    "mutator.api.audits": ("Audit", "seal", "verify"),
    "mutator.api.benches": ("Bench", "open_bench"),
    "mutator.api.caches": ("cache_entries", "cache_folder", "clear_caches", "prune_caches"),
    "mutator.api.campaigns": ("run",),
    "mutator.api.comparisons": ("RunComparison", "compare", "write_history"),
    "mutator.api.experiments": ("build_experiment",),
    "mutator.api.explorations": ("Envelopes", "Findings", "envelope", "search"),
    "mutator.api.experiment_results": ("TraceFrames",),
    "mutator.api.libraries": (
        "check_hazard_analysis",
        "check_library",
        "check_target",
        "doctor",
        "draw_control_structure",
        "import_library",
        "init_library",
    ),
    "mutator.api.mutant_files": ("MutantSet",),
    "mutator.api.operator_mutants": ("OperatorChoice",),
    "mutator.api.mutants": ("BuiltMutant", "build_mutant"),
    "mutator.api.plans": ("plan",),
    "mutator.api.reviews": ("ReviewedGroups", "load_review"),
    "mutator.api.run_experiments": ("RunExperiment",),
    "mutator.api.smallest_form": ("SmallestForm",),
    "mutator.api.run_envelopes": ("RunEnvelope",),
    "mutator.api.runs": ("Run", "load_run", "merge_runs"),
    "mutator.api.target_places": ("find_place_notes", "find_places"),
    "mutator.api.trials": ("Trial", "try_fault"),
    "mutator.campaigns.plan": ("Plan",),
    "mutator.comparison.run_comparison_and_gates": ("Gate",),
    "mutator.errors": ("CheckFailed", "IncompleteRun", "MutatorError", "MutatorWarning"),
    "mutator.execution.session_summary": ("Summary",),
    "mutator.explore.envelope": ("Envelope",),
    "mutator.explore.finding_search": ("Finding",),
    "mutator.exports": ("Format",),
    "mutator.model": ("Experiment", "Fault", "Outcome", "Record", "Status", "Trigger"),
    "mutator.onboarding.library_import": ("EntryOutcome", "ImportedEntry", "ImportedLibrary"),
    "mutator.report.experiment_filming": ("Shot",),
    "mutator.report.run_history": ("History",),
    "mutator.store.plan_choices": ("Choices",),
    "mutator.store.run_progress": ("Progress",),
    "mutator.audit.run_digests_and_seal": ("Seals",),
    "mutator.workspace": ("Workspace",),
}
_MODULE_BY_NAME = {name: home for home, names in NAMES_BY_MODULE.items() for name in names}

__all__ = sorted([*_MODULE_BY_NAME, "__version__"])


def __getattr__(name: str) -> Any:
    if name not in _MODULE_BY_NAME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    # so that Python does not ask again
    value = globals()[name] = getattr(import_module(_MODULE_BY_NAME[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
