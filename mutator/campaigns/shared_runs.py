"""Runs that several scenarios have in common: planned side by side, run once, counted in each."""

from collections.abc import Hashable, Iterable, Sequence

from mutator.model import Experiment
from mutator.targets.manifest import TargetManifest
from mutator.triggers.kinds import time_of


def run_key(manifest: TargetManifest, experiment: Experiment) -> Hashable:
    """The same for experiments that are one and the same run: all but the scenario is equal, and a change
    makes their scenarios the same (`same_in` of the manifest; the checks before a campaign prove it)."""
    scenarios = same_in(manifest, experiment.changes)
    place: Hashable = scenarios if experiment.scenario in scenarios else experiment.scenario
    return (experiment.fault.id, experiment.trigger, experiment.seed, experiment.changes, place)


def same_in(manifest: TargetManifest, changes: Sequence[str]) -> tuple[str, ...]:
    """The scenarios that are the same under these changes; empty: none is like another."""
    return next((manifest.same_in[change] for change in changes if change in manifest.same_in), ())


def in_turn(runs: Iterable[list[Experiment]]) -> list[list[Experiment]]:
    """The runs in the order that shares most work between one and the next: those of a golden run together,
    of these the ones with the same trigger, then the others by their times."""

    def turn(run: list[Experiment]) -> tuple[str, tuple[str, ...], float, str]:
        first = run[0]
        return (first.scenario, first.changes, time_of(first.trigger) or 0.0, first.trigger.condition)

    return sorted(runs, key=turn)


def runs(manifest: TargetManifest, experiments: Iterable[Experiment]) -> list[list[Experiment]]:
    """The experiments of each run, in the order of their firsts."""
    found: dict[Hashable, list[Experiment]] = {}
    for experiment in experiments:
        found.setdefault(run_key(manifest, experiment), []).append(experiment)
    return list(found.values())
