"""Report before a campaign why the forking engines cannot run a target or its faults."""

from dataclasses import replace

from mutator._common.files import ScratchFolder
from mutator._common.message_text import counted
from mutator.checks.findings import Finding, Level
from mutator.engines.forkable import not_forked, not_loadable
from mutator.errors import MutatorError, NotForkable
from mutator.faults.spec_expansion import expand
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

NAME = "fast engines"
_WITHOUT = "campaigns then run on the reference engine"
_DRIVE = "`mutator check --drive` names the lines that start threads in Python"
_LISTED = 3  # reasons


def loading(manifest: TargetManifest) -> Finding:
    """Import the target's modules, and report whether it can then be forked."""
    with ScratchFolder("mutator-check-") as scratch:
        told = finding(not_loadable(manifest, scratch / "server"))
    return replace(told, remedy=f"{told.remedy}; {_DRIVE}") if "thread" in told.found else told


def finding(refusal: NotForkable | None) -> Finding:
    if refusal is None:
        return Finding(name=NAME, level=Level.OK, found="runs can be forked")
    return Finding(
        name=NAME,
        level=Level.WARN,
        found=f"nothing can be forked: {refusal}",
        remedy=f"{refusal.remedy or 'see docs/explanation/performance.md'}; {_WITHOUT}",
    )


def variants(workspace: Workspace, manifest: TargetManifest) -> Finding:
    """Return the finding about variants whose mutants cannot be put into a loaded program."""
    models = workspace.fault_models()
    faults = [f for spec in workspace.specs() for f in expand(spec, 0, models=models, manifest=manifest)]
    count = len({fault.spec for fault in faults})
    reasons: dict[str, list[str]] = {}
    try:
        for name, why in not_forked(manifest, models, faults).items():
            reasons.setdefault(why, []).append(name)
    except MutatorError as error:
        return Finding(name="faults for fast engines", level=Level.WARN, found=str(error))
    if not reasons:
        found = f"{counted(count, 'variant')} can be forked"
        return Finding(name="faults for fast engines", level=Level.OK, found=found)
    told = "; ".join(
        f"{', '.join(names[:_LISTED])}{' and more' if len(names) > _LISTED else ''}: {why}"
        for why, names in list(reasons.items())[:_LISTED]
    )
    left = sum(map(len, reasons.values()))
    return Finding(
        name="faults for fast engines",
        level=Level.WARN,
        found=f"{left} of {counted(count, 'variant')} cannot be forked: {told}",
        remedy=_WITHOUT,
    )
