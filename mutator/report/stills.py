"""Takes stills of the worst experiments whose controller gets camera frames."""

import time
from collections.abc import Callable, Collection, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from itertools import islice
from pathlib import Path

from mutator._common.confined_files import path_below
from mutator._common.files import ScratchFolder
from mutator.errors import MutatorError
from mutator.model import Experiment, Record, Status
from mutator.report.film import Filming, Shot
from mutator.results.ranking import ranks_of_rows
from mutator.results.table_reader import Results
from mutator.store.planned_experiments import PlannedExperiments
from mutator.store.run_folder import GoldenRun, RunFolder
from mutator.store.run_progress import Progress, StagePace
from mutator.workspace import Workspace

MOST, ONE_IN = 10, 20  # at most 10 experiments, and at most one in 20 of the planned ones
BUDGET_S = 120.0  # no further experiment starts after this time

Notify = Callable[[Progress], None]


def take_stills(workspace: Workspace, folder: RunFolder, *, workers: int, notify: Notify) -> str:
    """Take the run's missing stills. Return why the first experiment without stills has none, or ''."""
    manifest = workspace.manifest(folder.head.target)
    if manifest.film is None or not manifest.film.pictures:
        return ""
    experiments = PlannedExperiments(folder.path)
    records = folder.records()
    due = _due(folder, manifest.film.pictures, experiments, records)
    if not due:
        return ""
    try:
        filming = Filming.of(workspace, folder)
    except MutatorError as error:
        return f"{next(iter(due))}: {error}"
    ends = time.monotonic() + BUDGET_S

    def wrong(name: str, golden: Future[Path]) -> str:
        if time.monotonic() > ends:
            return ""
        try:
            same = filming.take_shots(experiments[name], records[name], due[name], golden=golden.result())
        except MutatorError as error:
            return f"{name}: {error}"
        return "" if same else f"{name}: the rerun differs from the campaign's result"

    pool = ThreadPoolExecutor(max(1, workers))
    with ScratchFolder("mutator-stills-") as scratch:
        try:
            driven = {_golden_key(experiments[name]): experiments[name] for name in due}
            # golden runs are submitted first; otherwise all threads could wait for one that has not started
            goldens = {
                key: pool.submit(filming.rerun_golden, one, path_below(scratch, key))
                for key, one in driven.items()
            }
            found = [pool.submit(wrong, name, goldens[_golden_key(experiments[name])]) for name in due]
            pace = StagePace("pictures", len(found))
            notify(pace.progress_at(0))
            for done, _ in enumerate(as_completed(found), 1):
                notify(pace.progress_at(done))
            return next(filter(None, (one.result() for one in found)), "")
        finally:
            pool.shutdown(cancel_futures=True)


def _golden_key(experiment: Experiment) -> str:
    return GoldenRun.for_experiment(experiment, several_seeds=True).key


def _due(
    folder: RunFolder,
    pictures: Collection[str],
    experiments: Mapping[str, Experiment],
    records: Mapping[str, Record],
) -> dict[str, list[Shot]]:
    """Return the missing stills of the worst experiments with one of the changes `pictures`, worst first."""
    seeing = set(pictures)
    frame = Results(folder.path).frame()
    moved = ((frame["status"] == Status.OK.value) & frame["t_manifest"].notna()).to_numpy()
    order = [row for row in ranks_of_rows(frame).argsort() if moved[row]]
    ids = (str(frame["experiment_id"].iloc[row]) for row in order)
    wanted = (name for name in ids if seeing & set(experiments[name].changes))
    chosen = islice(wanted, min(MOST, folder.planned_count // ONE_IN))
    due = {name: _missing(folder, name, records[name]) for name in chosen}
    return {name: shots for name, shots in due.items() if shots}


def _missing(folder: RunFolder, experiment_id: str, record: Record) -> list[Shot]:
    names = {f"{experiment_id}-{t:.2f}s.jpg": t for t in _times(record)}
    shots = [Shot(path=path_below(folder.path / "plots", name), t=t) for name, t in names.items()]
    return [shot for shot in shots if not shot.path.exists()]


def _times(record: Record) -> Iterable[float]:
    """Yield the times of the activation, the first alert and the first hazard."""
    if record.activation:
        yield record.activation.first
    for events in (record.alerts, record.hazards):
        yield from sorted(t for _, t in events)[:1]
