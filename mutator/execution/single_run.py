"""Run one experiment outside a campaign and keep its whole output, for `try`, `show` and `rerun --trace`."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import mkdtemp

from mutator._common.confined_files import path_below
from mutator._common.files import make_folder, raising_disk_full, remove_folder, write_atomic
from mutator._common.folder_locks import locking_folder
from mutator.campaigns.run_inputs import RunInputs
from mutator.campaigns.run_provenance import check_sources
from mutator.engines.engine_jobs import EngineArguments, Job
from mutator.engines.reference_engine import ReferenceEngine
from mutator.engines.run_limits import LIMITS_THAT_ARE_MEASURED, limits_before_measuring, measure_limits
from mutator.errors import CheckFailed, MutatorError
from mutator.execution.experiment_runner import ExperimentRunner, RecordedExperiment
from mutator.execution.golden_hazards import GoldenHazardRules
from mutator.execution.inactivity_check import InactivityCheck
from mutator.execution.loaded_goldens import LoadedGoldens
from mutator.limits import Limits
from mutator.model import Experiment, GoldenClass, Record, Status
from mutator.mutants.mutant_building import Mutant
from mutator.preflight.check_run_problems import read_check_run
from mutator.store import plan_file
from mutator.store.planned_scenarios import PlannedScenarios
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest
from mutator.targets.required_packages import check_requirements
from mutator.workspace import Workspace


@dataclass(frozen=True, kw_only=True)
class SingleRun:
    """An experiment run alone. `golden` and `faulty` are output folders, for `load_trace`."""

    experiment: Experiment
    mutant: Mutant | None  # None if the mutant does not compile; the record then says why
    record: Record
    golden: Path
    faulty: Path
    log: str


def run_single(
    workspace: Workspace,
    manifest: TargetManifest,
    experiment: Experiment,
    out: Path,
    *,
    limits: Limits | None = None,
    golden: Path | None = None,
) -> SingleRun:
    """Run an experiment; write golden/ (unless given), faulty/ and mutant.patch into the folder `out`.

    Without `limits`, the golden run determines those of the faulty run. It runs also if the golden run has a
    hazard.

    faulty/ is empty if the mutant could not be built. Raises CheckFailed if the golden run fails.
    """
    if experiment.concrete is not None:
        planned = PlannedScenarios(out)
        planned.add(experiment.concrete)
        workspace = replace(workspace, planned_scenarios=planned)
    golden_limits = limits or limits_before_measuring(Limits())
    with _engine_in_folder(manifest, out, golden_limits) as engine:
        if golden is None:
            reference, cpu_s = _run_golden_on_engine(workspace, engine, experiment, out / "golden")
            if limits is None:
                measured = measure_limits(Limits(), LIMITS_THAT_ARE_MEASURED, [cpu_s])
                engine = ReferenceEngine(manifest, engine.work_folder, measured)
        else:
            reference = golden
        goldens = LoadedGoldens(manifest, lambda experiment: reference)
        models = workspace.fault_models()
        arguments = EngineArguments(
            manifest=manifest, models=models, work_folder=engine.work_folder, limits=engine.limits
        )
        check = InactivityCheck(arguments)
        runner = ExperimentRunner(
            manifest,
            models,
            engine,
            goldens,
            workspace.scenario,
            golden_hazard_rules=GoldenHazardRules(
                include=GoldenClass.HAZARD_WITHOUT_FAULT, scale=workspace.scale_of(manifest)
            ),
            inactivity_check=check,
        )
        (finished,) = _storing_output(runner.run([experiment]), out)
    return SingleRun(
        experiment=experiment,
        mutant=finished.mutant,
        record=finished.record,
        golden=reference,
        faulty=out / "faulty",
        log=finished.log_tail,
    )


def run_golden(
    workspace: Workspace, manifest: TargetManifest, experiment: Experiment, out: Path, *, limits: Limits
) -> Path:
    """Run an experiment without its fault; return the output folder, golden/ in `out`.

    Raises CheckFailed if the run fails.
    """
    with _engine_in_folder(manifest, out, limits) as engine:
        return _run_golden_on_engine(workspace, engine, experiment, out / "golden")[0]


def rerun_experiment(
    workspace: Workspace, run: Path, experiment_id: str, *, out: Path | None = None
) -> tuple[SingleRun, bool]:
    """Rerun a planned experiment, with output in the folder `out` (default: traces/<id>/ of the run folder).

    The second value is True if the record equals the campaign's, or if the campaign has none yet.
    MutatorError for an experiment that was left out.
    """
    folder = RunFolder.open(run)
    manifest = manifest_of_unchanged_target(workspace, folder)
    full_id = folder.experiment_id_from(experiment_id)
    experiment = next(e for e in plan_file.load_experiments(folder.path) if e.id == full_id)
    stored = folder.records().get(full_id)
    if stored is not None and stored.status is Status.LEFT_OUT:
        raise MutatorError(
            f"experiment {full_id} was left out: {stored.detail}",
            where=folder.path,
            expected="an experiment that ran",
            remedy=f"run it alone (`mutator try`), or write `include: {GoldenClass.HAZARD_WITHOUT_FAULT}` in "
            "the campaign",
        )
    golden = folder.golden_folder_of(experiment)
    single = run_single(
        workspace,
        manifest,
        experiment,
        out or folder.rerun_traces_folder(full_id),
        limits=folder.limits,
        golden=golden if golden.is_dir() else None,
    )
    return single, is_same_record(folder, stored, single.record)


def is_same_record(folder: RunFolder, stored: Record | None, rerun_record: Record) -> bool:
    """Return whether a rerun's record equals the campaign's; True if the campaign has none yet.

    Raises MutatorError if the patch of the campaign's record is damaged.
    """
    if stored is None:
        return True
    folder.read_patch(stored.experiment_id, stored)
    return stored == rerun_record


def manifest_of_unchanged_target(workspace: Workspace, folder: RunFolder) -> TargetManifest:
    """Return the target of a run; MutatorError if its sources have changed since the run."""
    manifest = workspace.manifest_of(folder.head)
    now = RunInputs.of_run(workspace, folder).digest_by_source()
    check_sources(folder.path, folder.head.sources, now)
    return manifest


@contextmanager
def _engine_in_folder(manifest: TargetManifest, out: Path, limits: Limits) -> Iterator[ReferenceEngine]:
    """Yield an engine that works in `out`. Its scratch folder is deleted afterwards."""
    check_requirements(manifest)
    make_folder(out)
    with locking_folder(out):
        work = out / "work"
        remove_folder(work)
        try:
            with raising_disk_full(work):
                work.mkdir()
            yield ReferenceEngine(manifest, work, limits)
        finally:
            remove_folder(work)


def _run_golden_on_engine(
    workspace: Workspace, engine: ReferenceEngine, experiment: Experiment, destination: Path
) -> tuple[Path, float]:
    """Return the output folder, and the CPU time of the run in s."""
    job = Job(
        name="golden",
        scenario=workspace.scenario(experiment.scenario),
        seed=experiment.seed,
        scenario_changes=experiment.changes,
    )
    execution = engine.execute(job, path_below(engine.work_folder, job.name))
    if execution.status is not Status.OK:
        raise CheckFailed(
            f"the run without any fault ended as {execution.status.value}: {execution.detail}",
            where=job.scenario,
            remedy="correct the target or the scenario first",
        )
    if problem := read_check_run(engine.manifest, execution).problem:
        raise CheckFailed(
            f"the run without any fault cannot be used: {problem}",
            where=job.scenario,
            remedy="correct the target or the scenario first",
        )
    _replace_folder(execution.out, destination)
    return destination, execution.cpu_s


def _storing_output(finished_runs: Iterator[RecordedExperiment], out: Path) -> Iterator[RecordedExperiment]:
    for finished in finished_runs:
        output = finished.output_folder
        if output is None or not output.is_dir():  # a run can delete it
            output = out / "work" / "nothing"
            output.mkdir()
        _replace_folder(output, out / "faulty")
        if finished.mutant is not None:
            write_atomic(out / "mutant.patch", finished.mutant.patch_bytes)
        yield finished


def _replace_folder(new: Path, destination: Path) -> None:
    """Replace a folder that another process might be reading."""
    aside = Path(mkdtemp(dir=new.parent))  # on the same disk, so that renaming moves nothing
    if os.path.lexists(destination):
        destination.rename(path_below(aside, destination.name))
    new.rename(destination)
    remove_folder(aside)
