"""Which engine runs a campaign: the one asked for, or the fastest that is sure to be worth it."""

import os
import sys
from collections.abc import Iterable
from pathlib import Path

from mutator.campaigns.campaign_files import Limits
from mutator.engines.code_swap import NotSwappable, plan_swap
from mutator.engines.fork import ForkEngine
from mutator.engines.reference import Engine, ReferenceEngine
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModels
from mutator.model import Fault
from mutator.mutants.building import build
from mutator.targets.manifest import TargetManifest
from mutator.triggers.conditions import always

REFERENCE, WARM, FORK = ENGINES = ("reference", "warm", "fork")
_WORTH_IT = 40  # experiments; of fewer, the proof alone would drive most again


def choose(asked: str | None, manifest: TargetManifest, experiments: int) -> str:
    """The engine for so many experiments; MutatorError when the one asked for cannot run this target here."""
    why = _not_forkable(manifest)
    if asked is None:
        return REFERENCE if why or experiments < _WORTH_IT else FORK
    if asked not in ENGINES:
        raise MutatorError(f"engine '{asked}'", expected=f"one of {', '.join(ENGINES)}")
    if asked != REFERENCE and why:
        raise MutatorError(f"engine '{asked}': {why}", remedy=f"use --engine {REFERENCE}")
    return asked


def _not_forkable(manifest: TargetManifest) -> str:
    """Why nothing of this target can be forked here; empty if it can."""
    if manifest.stepwise is None:
        return f"{manifest.path.name} names no `entry.stepwise`"
    if sys.platform != "linux":
        return "processes are forked on Linux only"
    try:
        os.close(os.pidfd_open(os.getpid()))
    except OSError:
        return "this kernel has no pidfd_open"
    return ""


def not_forked(manifest: TargetManifest, models: FaultModels, faults: Iterable[Fault]) -> dict[str, str]:
    """Variants that the reference engine runs, whatever is asked for, and why; one fault of each is tried."""
    variants = {fault.spec: fault for fault in faults}
    if why := _not_forkable(manifest):
        return dict.fromkeys(variants, why)
    found = {}
    for name, fault in variants.items():
        try:
            plan_swap(manifest, build(manifest, models, fault, always()).files, "")
        except NotSwappable as reason:
            found[name] = str(reason)
        except MutatorError:
            continue  # the checks before the campaign tell it, or it is not run at all
    return found


def make(
    name: str,
    manifest: TargetManifest,
    models: FaultModels,
    *,
    base: Path,
    work: Path,
    limits: Limits,
    parent: int | None,
) -> Engine:
    """The engine of that name."""
    if name == REFERENCE:
        return ReferenceEngine(manifest, base, work, limits, parent)
    null = build(manifest, models, None, always()).files
    return ForkEngine(manifest, base, work, limits, parent, null=null, warm=name == WARM)
