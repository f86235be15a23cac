"""What a run folder stores about an experiment. Nothing here reruns one, so no engine is imported."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path

from mutator._common.argument_checks import check_type
from mutator._common.confined_files import path_below
from mutator._common.library_and_run_folder_search import run_folders_newest_first
from mutator.api.experiment_results import ExperimentResult
from mutator.campaigns.expectations import Expectation
from mutator.campaigns.regression_files import save_regression
from mutator.errors import MutatorError
from mutator.model import Experiment, Fault, Record
from mutator.outcomes.fault_paths import FaultPath, FaultPathFinder, fault_paths_of
from mutator.outcomes.series_sampling import traces_of_series
from mutator.outcomes.trace_and_record_loading import Trace
from mutator.results.experiment_sentence import ExperimentSentences
from mutator.results.finished_experiments_and_columns import ResultColumn
from mutator.results.plan_columns import PlanColumn
from mutator.results.table_columns import result_columns_of
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.store.session_environments import SessionEnvironment
from mutator.store.time_series_folder import TimeSeriesFolder, rerun_command
from mutator.targets.hazard_severity import SeverityScale
from mutator.targets.manifest import TargetManifest
from mutator.targets.stored_target_facts import ChannelFacts
from mutator.workspace import Workspace

_BUILDING_MODULE = "mutator.mutants.mutant_building"


def find_newest_run(root: Path) -> Path:
    folders = run_folders_newest_first(root)
    if not folders:
        raise MutatorError(
            "no run folder in runs/",
            argument="run",
            remedy="name one with `run`, or make one: `mutator run quickstart --out runs/first`",
        )
    return relative_to_here(folders[0])


def relative_to_here(path: Path) -> Path:
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


@dataclass(frozen=True, eq=False, repr=False)
class StoredRun:
    """A run folder and its workspace."""

    folder: RunFolder  #: reads the files of the run folder
    given_workspace: Workspace | None = None  #: the workspace that was passed; None: found when needed

    @property
    def path(self) -> Path:
        """The folder."""
        return self.folder.path

    @cached_property
    def workspace(self) -> Workspace:
        """The library, templates and target of the run."""
        return self.given_workspace or Workspace.find()

    @cached_property
    def manifest(self) -> TargetManifest:
        """The manifest of the run's target in the workspace."""
        return self.workspace.manifest_of(self.folder.head)

    @cached_property
    def faults(self) -> dict[str, Fault]:
        """The planned faults by id: value, aim, and what is injected where."""
        return plan_file.load_faults(self.path)

    @cached_property
    def experiments(self) -> dict[str, Experiment]:
        """The planned experiments by id, in plan order."""
        return {e.id: e for e in plan_file.load_experiments(self.path)}

    @cached_property
    def records(self) -> Mapping[str, Record]:
        """The records by experiment id."""
        return self.folder.records()

    @cached_property
    def fault_paths(self) -> FaultPathFinder | None:
        """The paths of faults through the target; None if unknown."""
        return fault_paths_of(self.folder)

    @cached_property
    def sentences(self) -> ExperimentSentences:
        """Writes the sentences about the run's experiments."""
        return ExperimentSentences.of_run(self.folder.head)

    def experiment(self, id: str) -> "StoredExperiment":
        """Return the planned experiment whose id starts with `id`; MutatorError for none or several."""
        experiment_id = self._find_experiment_id(id)
        return StoredExperiment(
            experiment=self.experiments[experiment_id], record=self.records.get(experiment_id), run=self
        )

    def _find_experiment_id(self, id: str) -> str:
        check_type("id", id, str, "the id of an experiment, or the start of one")
        return self.folder.experiment_id_from(id)


def open_stored_run(path: Path, workspace: Workspace | None = None) -> StoredRun:
    """Open the run folder at `path`; MutatorError if it is not one."""
    return StoredRun(RunFolder.open(path), workspace)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class StoredExperiment(ExperimentResult):
    """An experiment of a run, as far as the run folder stores it."""

    run: StoredRun  #: the run that it belongs to

    @cached_property
    def patch(self) -> str:
        """The whole patch, including the probe."""
        stored_patch = self.run.folder.read_patch(self.id, self.record)
        if stored_patch is not None:
            return stored_patch.decode("utf-8", "surrogateescape")  # a source can have another encoding
        # late: what only reads a stored patch loads no parser of Python
        build = import_module(_BUILDING_MODULE).build
        models = self.run.workspace.fault_models()
        patch: str = build(self.run.manifest, models, self.fault, self.experiment.trigger).patch
        return patch

    @property
    def scale(self) -> SeverityScale | None:
        """The severity scale that the run was planned with."""
        return self.run.folder.severity_scale

    @property
    def stretch(self) -> SessionEnvironment | None:
        """The versions and the machine of the experiment's run; None until it has run."""
        return self.run.folder.environment_of(self.id)

    @property
    def plot_file(self) -> Path:
        """Path of the plot in the run folder."""
        return path_below(self.run.path / "plots", f"{self.id}.svg")

    @property
    def has_series(self) -> bool:
        """Whether the run folder has an undamaged series of the experiment."""
        return self.record is not None and TimeSeriesFolder(self.run.path).is_readable(self.id, self.record)

    @property
    def is_drawn(self) -> bool:
        """Whether the run folder has the plot and an undamaged series."""
        return self.record is not None and self.plot_file.exists() and self.has_series

    def save_regression(self, file: str | Path) -> None:
        """Add the experiment to a file of saved experiments, which pytest collects.

        It is then expected to reach no other hazard than in this run. MutatorError if it has no result, and
        for a file of another target or with the experiment in it.
        """
        if self.record is None:
            raise self.not_run_error()
        hazards = list(dict.fromkeys(name for name, _ in self.record.hazards))
        save_regression(
            Path(file),
            self.run.folder.head.target,
            self.experiment,
            Expectation(hazards=hazards),
            self.sentence,
        )

    def not_run_error(self) -> MutatorError:
        """Return the error for an experiment that has not run."""
        campaign, out = self.run.folder.head.campaign, relative_to_here(self.run.path)
        return MutatorError(
            f"experiment {self.id} has not run yet",
            where=self.run.path,
            remedy=f"run it: `mutator run {campaign} --out {out}`",
        )

    @property
    def fault_path(self) -> FaultPath | None:
        """How far the fault propagated along the control structure; None if that is unknown, if the fault was
        never active, or if the run has no outcome.
        """
        fault_paths = self.run.fault_paths
        return fault_paths.fault_path(self.experiment, self.record) if fault_paths and self.record else None

    def _sentences(self) -> ExperimentSentences:
        return self.run.sentences

    def _columns(self) -> Sequence[PlanColumn | ResultColumn]:
        return result_columns_of(self.run.folder)

    def _fault_paths(self) -> FaultPathFinder | None:
        return self.run.fault_paths

    def _channels(self) -> Sequence[ChannelFacts]:
        return self.run.folder.head.channels

    def _manifest(self) -> TargetManifest:
        return self.run.manifest

    def _load_traces(self) -> tuple[Trace, Trace]:
        if self.record is None:
            raise self.not_run_error()
        series = TimeSeriesFolder(self.run.path).load_series(self.id, self.record)
        if series is None:
            remedy = f"rerun the experiment: {rerun_command(self.run.path, self.id)}"
            raise MutatorError(f"no series of {self.id}", where=self.run.path, remedy=remedy)
        return traces_of_series(*series, self._manifest().time_channel)
