"""The traces of a run's experiments: stored ones, and ones made on request."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from mutator._common.confined_files import path_below
from mutator.errors import MutatorError
from mutator.execution.single_run import rerun_experiment
from mutator.model import Experiment, Record
from mutator.outcomes.series_sampling import traces_of_series, write_sampled_series
from mutator.outcomes.trace_and_record_loading import Trace, load_trace, trace_digest
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.store.time_series_folder import TimeSeriesFolder, rerun_command
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace


@dataclass(frozen=True)
class RunTraces:
    """The fault-free and faulty traces of any experiment in a run folder."""

    workspace: Workspace
    folder: RunFolder

    @cached_property
    def manifest(self) -> TargetManifest:
        return self.workspace.manifest_of(self.folder.head)

    @cached_property
    def _records(self) -> Mapping[str, Record]:
        return self.folder.records()

    @cached_property
    def _experiments(self) -> Mapping[str, Experiment]:
        return {experiment.id: experiment for experiment in plan_file.load_experiments(self.folder.path)}

    def record(self, experiment_id: str) -> Record:
        if experiment_id not in self._records:
            raise MutatorError(f"the record of {experiment_id} is missing", where=self.folder.path)
        return self._records[experiment_id]

    def traces_of(self, experiment_id: str) -> tuple[Trace, Trace]:
        """Return the fault-free and the faulty trace of an experiment that ended normally.

        Reruns the experiment if no trace is stored. Raises MutatorError if that is impossible, or if the
        result differs from the campaign's.
        """
        stored = self.folder.rerun_traces_folder(experiment_id)
        experiment = self._experiments[experiment_id]
        golden = self.folder.golden_folder_of(experiment)
        if not golden.is_dir():
            golden = stored / "golden"
        if not (golden.is_dir() and self.is_faulty_trace_stored(experiment_id)):
            single, same = rerun_experiment(self.workspace, self.folder.path, experiment_id)
            if not same:
                raise MutatorError(f"the rerun of {experiment_id} differs from the campaign's record")
            golden = single.golden
        return load_trace(self.manifest, golden), load_trace(self.manifest, stored / "faulty")

    def sampled_traces_of(self, experiment_id: str, *, rerun_if_missing: bool = False) -> tuple[Trace, Trace]:
        """Return the fault-free and the faulty trace from an experiment's series, at most 20 values a second.

        Without a series, the experiment is rerun if `rerun_if_missing` is set. Raises MutatorError if there
        is no series, if it is damaged, or if the rerun fails.
        """
        series = TimeSeriesFolder(self.folder.path)
        record = self.record(experiment_id)
        series_pair = series.load_series(experiment_id, record)
        if series_pair is None and rerun_if_missing:
            write_sampled_series(self.folder.path, self.manifest, *self.traces_of(experiment_id), record)
            series_pair = series.load_series(experiment_id, record)
        if series_pair is None:
            raise MutatorError(
                f"no series of {experiment_id}",
                where=self.folder.path,
                remedy=f"rerun the experiment: {rerun_command(self.folder.path, experiment_id)}",
            )
        return traces_of_series(*series_pair, self.manifest.time_channel)

    def is_faulty_trace_stored(self, experiment_id: str) -> bool:
        """Return whether a stored faulty trace matches the record."""
        faulty = self.folder.rerun_traces_folder(experiment_id) / "faulty"
        if not path_below(faulty, self.manifest.trace_file).is_file():
            return False
        return trace_digest(self.manifest, faulty) == self.record(experiment_id).trace_digest
