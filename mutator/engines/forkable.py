"""What a forking engine can run: loadable targets, and faults whose code can be put into a loaded program."""

from collections.abc import Iterable
from pathlib import Path

from mutator.engines.code_swap_planning import plan_swap
from mutator.engines.engine_choice import reason_not_forkable
from mutator.engines.fork_server_processes import ForkServer
from mutator.errors import ForkServerLost, MutantNotSwappable, MutatorError, NotForkable
from mutator.faults.fault_models import FaultModels
from mutator.model import Fault
from mutator.mutants.mutant_building import build
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import always_trigger


def find_obstacle_before_loading(manifest: TargetManifest) -> NotForkable | None:
    """Return why the target cannot be forked here, as far as that is known without loading it."""
    why = reason_not_forkable(manifest)
    stepwise = (
        ""
        if manifest.stepwise_function
        else f"in {manifest.path.name}, name a function that makes stepwise runs"
    )
    return NotForkable(why, stepwise) if why else None


def find_obstacle_by_loading(manifest: TargetManifest, scratch_folder: Path) -> NotForkable | None:
    """Load the target, and return why it cannot be forked; None if it can.

    `scratch_folder` is a new folder.
    """
    if obstacle := find_obstacle_before_loading(manifest):
        return obstacle
    try:
        ForkServer(manifest, scratch_folder, None, scratch_folder).close()
    except NotForkable as why:
        return why
    except ForkServerLost as why:
        return NotForkable(str(why))
    return None


def reasons_by_unforkable_variant(
    manifest: TargetManifest, models: FaultModels, faults: Iterable[Fault]
) -> dict[str, str]:
    """Return the variants that only the reference engine can run, with reasons; test one fault of each."""
    variants = {fault.spec: fault for fault in faults}
    if why := reason_not_forkable(manifest):
        return dict.fromkeys(variants, why)
    reasons = {}
    for name, fault in variants.items():
        try:
            mutant = build(manifest, models, fault, always_trigger())
            plan_swap(manifest, mutant.files, mutant.probe_source, "")
        except MutantNotSwappable as reason:
            reasons[name] = str(reason)
        except MutatorError:
            continue  # a fault that cannot be built never runs; the checks before a campaign report it
    return reasons
