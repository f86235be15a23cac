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
from mutator._common.confined_files import path_below
from mutator._common.message_text import counted
from mutator.engines.first_activation import is_active_at_observations
from mutator.model import Experiment, Trigger
from mutator.mutants.mutant_building import build
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import trigger_time_s
from mutator.workspace import Workspace

OBSERVATIONS_FOLDER = "observed"
_MOST_NAMED_TRIGGERS = 4  # triggers that a warning names

# a row for each observation: the time (s), then the values
Observations: TypeAlias = "np.ndarray[Any, np.dtype[np.float64]]"
ArmedCondition = tuple[float, str]  # of a trigger's probe


def save_observations(folder: Path, key: str, observations: Iterable[Sequence[float]]) -> None:
    path = path_below(folder / OBSERVATIONS_FOLDER, f"{key}.npy")
    path.parent.mkdir(parents=True, exist_ok=True)  # scenario names can contain folders
    np.save(path, np.array(list(observations), dtype=float))


def load_observations(folder: Path) -> dict[str, Observations]:
    base = folder / OBSERVATIONS_FOLDER
    path_by_name = {path.relative_to(base).as_posix(): path for path in base.rglob("*.npy")}
    return {
        name.removesuffix(".npy"): np.load(io.BytesIO(read_bounded(path)))
        for name, path in path_by_name.items()
    }


def armed_condition_of(workspace: Workspace, manifest: TargetManifest, trigger: Trigger) -> ArmedCondition:
    return build(manifest, workspace.fault_models(), None, trigger).probe_source.armed_condition


def is_ever_active(condition: ArmedCondition, observations: Observations) -> bool:
    return bool(len(observations) and is_active_at_observations(condition, observations.T).any())


def describe_unreached(
    workspace: Workspace,
    manifest: TargetManifest,
    experiments: Iterable[tuple[str, Experiment]],
    observed: Mapping[str, Observations],
) -> list[str]:
    """Remarks on triggers that never hold. Each experiment comes with its golden run's key."""
    late, never = Counter[str](), Counter[str]()
    condition_by_trigger: dict[Trigger, ArmedCondition] = {}
    holds_by_run: dict[tuple[str, Trigger], bool] = {}
    total = 0
    for key, experiment in experiments:
        total += 1
        trigger = experiment.trigger
        if key not in observed or not len(observed[key]):
            continue
        if (time := trigger_time_s(trigger)) is not None:
            if time > (end := observed[key][:, 0].max()):
                late[f"{experiment.scenario}, which ends at {end:g} s"] += 1
            continue
        if (key, trigger) not in holds_by_run:
            if trigger not in condition_by_trigger:
                condition_by_trigger[trigger] = armed_condition_of(workspace, manifest, trigger)
            holds_by_run[key, trigger] = is_ever_active(condition_by_trigger[trigger], observed[key])
        if not holds_by_run[key, trigger]:
            never[f"{trigger.name} in {experiment.scenario}"] += 1
    return list(_describe_unreached_counts(total, late, never))


def _describe_unreached_counts(total: int, late: Counter[str], never: Counter[str]) -> Iterator[str]:
    for counts, what in (
        (late, "the scenario ends before the time of"),
        (never, "no golden run reaches the trigger of"),
    ):
        if counts:
            named = [f"{name}: {count}" for name, count in counts.most_common(_MOST_NAMED_TRIGGERS)]
            more = (
                [f"and {len(counts) - _MOST_NAMED_TRIGGERS} more"]
                if len(counts) > _MOST_NAMED_TRIGGERS
                else []
            )
            count = f"{counts.total()} of {counted(total, 'experiment')}"
            yield f"{what} {count}, which will therefore be not_activated ({', '.join(named + more)})"
