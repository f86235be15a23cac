"""Runs that several scenarios share: planned together, run once, counted in each scenario."""

from collections.abc import Hashable, Iterable, Sequence

from mutator.model import Experiment
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import trigger_time_s


def run_key(manifest: TargetManifest, experiment: Experiment) -> Hashable:
    """Return a key that is equal for experiments that share a run.

    Such experiments differ only in scenarios that a change makes identical. The manifest lists these
    scenarios in `same_in`, and the preflight checks that they are identical.
    """
    scenarios = scenarios_sharing_runs(manifest, experiment.changes)
    place: Hashable = scenarios if experiment.scenario in scenarios else experiment.scenario
    trigger = (experiment.trigger, experiment.end_s)
    return (experiment.fault.id, trigger, experiment.seed, experiment.changes, place)


def scenarios_sharing_runs(manifest: TargetManifest, changes: Sequence[str]) -> tuple[str, ...]:
    return next(
        (
            manifest.same_scenarios_by_change[change]
            for change in changes
            if change in manifest.same_scenarios_by_change
        ),
        (),
    )


def order_for_sharing(runs: Iterable[list[Experiment]]) -> list[list[Experiment]]:
    """Order runs so that they share the most work: by golden run, trigger time and condition."""

    def sort_key(run: list[Experiment]) -> tuple[str, tuple[str, ...], float, str]:
        first = run[0]
        return (first.scenario, first.changes, trigger_time_s(first.trigger) or 0.0, first.trigger.condition)

    return sorted(runs, key=sort_key)


def group_by_run(manifest: TargetManifest, experiments: Iterable[Experiment]) -> list[list[Experiment]]:
    """Return the experiments of each run, in the order of each run's first experiment."""
    experiments_by_run: dict[Hashable, list[Experiment]] = {}
    for experiment in experiments:
        experiments_by_run.setdefault(run_key(manifest, experiment), []).append(experiment)
    return list(experiments_by_run.values())
