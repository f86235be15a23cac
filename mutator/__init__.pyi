# Generated from `NAMES_BY_MODULE` in __init__.py by `python -m mutator.reference`; do not edit.
from mutator.api.audits import Audit as Audit
from mutator.api.audits import seal as seal
from mutator.api.audits import verify as verify
from mutator.api.benches import Bench as Bench
from mutator.api.benches import open_bench as open_bench
from mutator.api.caches import cache_entries as cache_entries
from mutator.api.caches import cache_folder as cache_folder
from mutator.api.caches import clear_caches as clear_caches
from mutator.api.caches import prune_caches as prune_caches
from mutator.api.campaigns import run as run
from mutator.api.comparisons import RunComparison as RunComparison
from mutator.api.comparisons import compare as compare
from mutator.api.comparisons import write_history as write_history
from mutator.api.experiment_results import TraceFrames as TraceFrames
from mutator.api.experiments import build_experiment as build_experiment
from mutator.api.explorations import Envelopes as Envelopes
from mutator.api.explorations import Findings as Findings
from mutator.api.explorations import envelope as envelope
from mutator.api.explorations import search as search
from mutator.api.libraries import check_hazard_analysis as check_hazard_analysis
from mutator.api.libraries import check_library as check_library
from mutator.api.libraries import check_target as check_target
from mutator.api.libraries import doctor as doctor
from mutator.api.libraries import draw_control_structure as draw_control_structure
from mutator.api.libraries import import_library as import_library
from mutator.api.libraries import init_library as init_library
from mutator.api.mutant_files import MutantSet as MutantSet
from mutator.api.mutants import BuiltMutant as BuiltMutant
from mutator.api.mutants import build_mutant as build_mutant
from mutator.api.operator_mutants import OperatorChoice as OperatorChoice
from mutator.api.plans import plan as plan
from mutator.api.reviews import ReviewedGroups as ReviewedGroups
from mutator.api.reviews import load_review as load_review
from mutator.api.run_envelopes import RunEnvelope as RunEnvelope
from mutator.api.run_experiments import RunExperiment as RunExperiment
from mutator.api.runs import Run as Run
from mutator.api.runs import load_run as load_run
from mutator.api.runs import merge_runs as merge_runs
from mutator.api.smallest_form import SmallestForm as SmallestForm
from mutator.api.target_places import find_place_notes as find_place_notes
from mutator.api.target_places import find_places as find_places
from mutator.api.trials import Trial as Trial
from mutator.api.trials import try_fault as try_fault
from mutator.audit.run_digests_and_seal import Seals as Seals
from mutator.campaigns.plan import Plan as Plan
from mutator.comparison.run_comparison_and_gates import Gate as Gate
from mutator.errors import CheckFailed as CheckFailed
from mutator.errors import IncompleteRun as IncompleteRun
from mutator.errors import MutatorError as MutatorError
from mutator.errors import MutatorWarning as MutatorWarning
from mutator.execution.session_summary import Summary as Summary
from mutator.explore.envelope import Envelope as Envelope
from mutator.explore.finding_search import Finding as Finding
from mutator.exports import Format as Format
from mutator.model import Experiment as Experiment
from mutator.model import Fault as Fault
from mutator.model import Outcome as Outcome
from mutator.model import Record as Record
from mutator.model import Status as Status
from mutator.model import Trigger as Trigger
from mutator.onboarding.library_import import EntryOutcome as EntryOutcome
from mutator.onboarding.library_import import ImportedEntry as ImportedEntry
from mutator.onboarding.library_import import ImportedLibrary as ImportedLibrary
from mutator.report.experiment_filming import Shot as Shot
from mutator.report.run_history import History as History
from mutator.store.plan_choices import Choices as Choices
from mutator.store.run_progress import Progress as Progress
from mutator.workspace import Workspace as Workspace

NAMES_BY_MODULE: dict[str, tuple[str, ...]]
__version__: str

__all__ = [
    "Audit",
    "Bench",
    "BuiltMutant",
    "CheckFailed",
    "Choices",
    "EntryOutcome",
    "Envelope",
    "Envelopes",
    "Experiment",
    "Fault",
    "Finding",
    "Findings",
    "Format",
    "Gate",
    "History",
    "ImportedEntry",
    "ImportedLibrary",
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
    "RunEnvelope",
    "RunExperiment",
    "Seals",
    "Shot",
    "SmallestForm",
    "Status",
    "Summary",
    "TraceFrames",
    "Trial",
    "Trigger",
    "Workspace",
    "__version__",
    "build_experiment",
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
    "envelope",
    "find_place_notes",
    "find_places",
    "import_library",
    "init_library",
    "load_review",
    "load_run",
    "merge_runs",
    "open_bench",
    "plan",
    "prune_caches",
    "run",
    "seal",
    "search",
    "try_fault",
    "verify",
    "write_history",
]
