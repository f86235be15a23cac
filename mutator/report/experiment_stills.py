"""Takes stills of the worst experiments whose controller gets camera frames."""

import time
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from itertools import islice
from pathlib import Path

from mutator._common.confined_files import path_below
from mutator._common.files import ScratchFolder
from mutator.errors import MutatorError
from mutator.model import Experiment, Record, Status
from mutator.report.experiment_filming import ExperimentFilmer, Shot
from mutator.results.table_reader import Results
from mutator.results.worst_first_ranking import worst_first_ranks
from mutator.store.golden_runs import GoldenRun
from mutator.store.planned_experiments import PlannedExperiments
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import Progress, StagePace
from mutator.workspace import Workspace

MOST_FILMED_EXPERIMENTS = 10
PLANNED_PER_FILMED_EXPERIMENT = 20  # small campaigns should not spend most of their time on stills
LAST_START_S = 120.0  # no further experiment starts after this time

OnProgress = Callable[[Progress], None]


def take_stills(workspace: Workspace, folder: RunFolder, *, workers: int, on_progress: OnProgress) -> str:
    """Take the run's missing stills. Return why the first experiment without stills has none, or ''."""
    manifest = workspace.manifest_of(folder.head)
    if manifest.film is None or not manifest.film.pictures:
        return ""
    experiments = PlannedExperiments(folder.path)
    records = folder.records()
    missing_stills = _missing_stills_by_id(folder, manifest.film.pictures, experiments, records)
    if not missing_stills:
        return ""
    try:
        filming = ExperimentFilmer.of(workspace, folder)
    except MutatorError as error:
        return f"{next(iter(missing_stills))}: {error}"
    deadline = time.monotonic() + LAST_START_S

    def take_and_report_problem(name: str, golden: Future[Path]) -> str:
        if time.monotonic() > deadline:
            return ""
        try:
            same = filming.rerun_and_write_shots(
                experiments[name], records[name], missing_stills[name], golden=golden.result()
            )
        except MutatorError as error:
            return f"{name}: {error}"
        return "" if same else f"{name}: the rerun differs from the campaign's result"

    pool = ThreadPoolExecutor(max(1, workers))
    with ScratchFolder("mutator-stills-") as scratch:
        try:
            experiment_by_golden, times_by_golden = {}, defaultdict[str, list[float]](list)
            for name, shots in missing_stills.items():
                key = _golden_run_key(experiments[name])
                experiment_by_golden[key] = experiments[name]
                times_by_golden[key] += [shot.t for shot in shots if shot.t is not None]
            # golden runs are submitted first; otherwise all threads could wait for one that has not started
            goldens = {
                key: pool.submit(
                    filming.rerun_golden, experiment, path_below(scratch, key), times_by_golden[key]
                )
                for key, experiment in experiment_by_golden.items()
            }
            futures = [
                pool.submit(take_and_report_problem, name, goldens[_golden_run_key(experiments[name])])
                for name in missing_stills
            ]
            pace = StagePace("pictures", len(futures))
            on_progress(pace.progress_at(0))
            for done_count, _ in enumerate(as_completed(futures), 1):
                on_progress(pace.progress_at(done_count))
            return next(filter(None, (future.result() for future in futures)), "")
        finally:
            pool.shutdown(cancel_futures=True)


def _golden_run_key(experiment: Experiment) -> str:
    return GoldenRun.for_experiment(experiment, several_seeds=True).key


def _missing_stills_by_id(
    folder: RunFolder,
    pictures: Collection[str],
    experiments: Mapping[str, Experiment],
    records: Mapping[str, Record],
) -> dict[str, list[Shot]]:
    """Return the missing stills of the worst experiments with one of the changes `pictures`, worst first."""
    change_names = set(pictures)
    frame = Results(folder.path).frame()
    is_manifested = ((frame["status"] == Status.OK.value) & frame["t_manifest"].notna()).to_numpy()
    order = [row for row in worst_first_ranks(frame).argsort() if is_manifested[row]]
    ids = (str(frame["experiment_id"].iloc[row]) for row in order)
    with_pictures = (name for name in ids if change_names & set(experiments[name].changes))
    worst_ids = islice(
        with_pictures,
        min(MOST_FILMED_EXPERIMENTS, folder.planned_experiment_count // PLANNED_PER_FILMED_EXPERIMENT),
    )
    stills_by_id = {name: _missing_stills(folder, name, records[name]) for name in worst_ids}
    return {name: shots for name, shots in stills_by_id.items() if shots}


def _missing_stills(folder: RunFolder, experiment_id: str, record: Record) -> list[Shot]:
    names = {f"{experiment_id}-{t:.2f}s.jpg": t for t in _still_times(record)}
    shots = [Shot(path=path_below(folder.path / "plots", name), t=t) for name, t in names.items()]
    return [shot for shot in shots if not shot.path.exists()]


def _still_times(record: Record) -> Iterable[float]:
    """Yield the times of the activation, the first alert and the first hazard."""
    if record.activation:
        yield record.activation.first
    for events in (record.alerts, record.hazards):
        yield from sorted(t for _, t in events)[:1]
