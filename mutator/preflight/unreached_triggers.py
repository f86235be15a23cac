"""Find triggers that no golden run reaches.

A faulty run equals the golden run until its fault is active, so a trigger that never holds in the golden run
never fires. The run of a null mutant equals its golden run, and it records the observed values.
"""

import io
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import inside
from mutator._common.message_text import counted
from mutator.engines.first_activation import active_at
from mutator.model import Experiment, Trigger
from mutator.mutants.mutant_building import build
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import time_of
from mutator.workspace import Workspace

FOLDER = "observed"
_NAMED = 4  # triggers that a warning names

# a row for each observation: the time (s), then the values
Observed: TypeAlias = "np.ndarray[Any, np.dtype[np.float64]]"
Decision = tuple[float, str]  # of a trigger's probe


def write_observed(folder: Path, key: str, seen: Iterable[Sequence[float]]) -> None:
    path = inside(folder / FOLDER, f"{key}.npy")
    path.parent.mkdir(parents=True, exist_ok=True)  # scenario names can contain folders
    np.save(path, np.array(list(seen), dtype=float))


def read_observed(folder: Path) -> dict[str, Observed]:
    base = folder / FOLDER
    found = {path.relative_to(base).as_posix(): path for path in base.rglob("*.npy")}
    return {
        name.removesuffix(".npy"): np.load(io.BytesIO(read_bounded(path))) for name, path in found.items()
    }


def decision_of(workspace: Workspace, manifest: TargetManifest, trigger: Trigger) -> Decision:
    return build(manifest, workspace.fault_models(), None, trigger).probe.decision


def holds(decision: Decision, observed: Observed) -> bool:
    return bool(len(observed) and active_at(decision, observed.T).any())


def remarks(
    workspace: Workspace,
    manifest: TargetManifest,
    experiments: Iterable[tuple[str, Experiment]],
    observed: Mapping[str, Observed],
) -> list[str]:
    """Remarks on triggers that never hold. Each experiment comes with its golden run's key."""
    late, never = Counter[str](), Counter[str]()
    decisions: dict[Trigger, Decision] = {}
    known: dict[tuple[str, Trigger], bool] = {}
    total = 0
    for key, experiment in experiments:
        total += 1
        trigger = experiment.trigger
        if key not in observed or not len(observed[key]):
            continue
        if (time := time_of(trigger)) is not None:
            if time > (end := observed[key][:, 0].max()):
                late[f"{experiment.scenario}, which ends at {end:g} s"] += 1
            continue
        if (key, trigger) not in known:
            if trigger not in decisions:
                decisions[trigger] = decision_of(workspace, manifest, trigger)
            known[key, trigger] = holds(decisions[trigger], observed[key])
        if not known[key, trigger]:
            never[f"{trigger.name} in {experiment.scenario}"] += 1
    return list(_sentences(total, late, never))


def _sentences(total: int, late: Counter[str], never: Counter[str]) -> Iterator[str]:
    for counts, what in (
        (late, "the scenario ends before the time of"),
        (never, "no golden run reaches the trigger of"),
    ):
        if counts:
            named = [f"{name}: {count}" for name, count in counts.most_common(_NAMED)]
            more = [f"and {len(counts) - _NAMED} more"] if len(counts) > _NAMED else []
            count = f"{counts.total()} of {counted(total, 'experiment')}"
            yield f"{what} {count}, which will therefore be not_activated ({', '.join(named + more)})"
