"""Report before a campaign why the forking engines cannot run a target or its faults."""

from dataclasses import replace

from mutator._common.files import ScratchFolder
from mutator._common.message_text import counted
from mutator.checks.check_findings import CheckState, Finding
from mutator.engines.engine_jobs import JobResult
from mutator.engines.forkable import find_obstacle_by_loading, reasons_by_unforkable_variant
from mutator.engines.thread_messages import describe_too_many_threads, remedy_for_threads
from mutator.errors import MutatorError, NotForkable
from mutator.faults.spec_expansion import expand_spec
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

FINDING_NAME = "fast engines"
_FALLBACK_NOTE = "without forks, campaigns run on the reference engine"
_DRIVE_CHECK_NOTE = "`mutator check --drive` names the lines that start threads in Python"
_MOST_LISTED = 3  # reasons


def import_and_fork_finding(manifest: TargetManifest) -> Finding:
    """Import the target's modules, and report whether it can then be forked."""
    with ScratchFolder("mutator-check-") as scratch:
        import_finding = forking_finding(find_obstacle_by_loading(manifest, scratch / "server"))
    return (
        replace(import_finding, remedy=f"{import_finding.remedy}; {_DRIVE_CHECK_NOTE}")
        if "thread" in import_finding.found
        else import_finding
    )


def forking_finding(refusal: NotForkable | None) -> Finding:
    if refusal is None:
        return Finding(name=FINDING_NAME, level=CheckState.OK, found="runs can be forked")
    return Finding(
        name=FINDING_NAME,
        level=CheckState.WARN,
        found=f"nothing can be forked: {refusal}",
        remedy=f"{refusal.remedy or 'see docs/explanation/performance.md'}; {_FALLBACK_NOTE}",
    )


def unloadable_variants_finding(workspace: Workspace, manifest: TargetManifest) -> Finding:
    """Return the finding about variants whose mutants cannot be put into a loaded program."""
    models = workspace.fault_models()
    faults = [f for spec in workspace.specs() for f in expand_spec(spec, 0, models=models, manifest=manifest)]
    count = len({fault.spec for fault in faults})
    reasons: dict[str, list[str]] = {}
    try:
        for name, why in reasons_by_unforkable_variant(manifest, models, faults).items():
            reasons.setdefault(why, []).append(name)
    except MutatorError as error:
        return Finding(name="faults for fast engines", level=CheckState.WARN, found=str(error))
    if not reasons:
        message = f"{counted(count, 'variant')} can be forked"
        return Finding(name="faults for fast engines", level=CheckState.OK, found=message)
    listed_reasons = "; ".join(
        f"{', '.join(names[:_MOST_LISTED])}{' and more' if len(names) > _MOST_LISTED else ''}: {why}"
        for why, names in list(reasons.items())[:_MOST_LISTED]
    )
    unforkable_count = sum(map(len, reasons.values()))
    return Finding(
        name="faults for fast engines",
        level=CheckState.WARN,
        found=f"{unforkable_count} of {counted(count, 'variant')} cannot be forked: {listed_reasons}",
        remedy=_FALLBACK_NOTE,
    )


def forking_refusal_by_threads(execution: JobResult) -> NotForkable | None:
    """Return why a run cannot be forked that has started threads; None if it has started none."""
    threads = execution.watch_report.get("threads", [])
    return NotForkable(describe_too_many_threads(threads), remedy_for_threads(threads)) if threads else None
