"""The golden runs that a worker compares with, loaded on request and checked against changes."""

from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple, TypeVar

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import path_below
from mutator._common.file_change_detection import FileChangeDetector
from mutator.engines.engine_jobs import GoldenEnd
from mutator.errors import MutatorError
from mutator.model import Experiment
from mutator.outcomes.hazard_and_metric_judgement import RunJudgement, judge_run, load_manifest_channels
from mutator.outcomes.series_sampling import SeriesSampler
from mutator.outcomes.trace_and_record_loading import Trace, load_target_record
from mutator.preflight.check_run_problems import output_digest_of
from mutator.store.checks_file import HazardTimes
from mutator.store.golden_runs import GoldenRun
from mutator.targets.manifest import TargetManifest

_T = TypeVar("_T")
_MOST_GOLDENS_IN_MEMORY = 32  # golden runs in memory: enough for the current seed and the next


class _GoldenOutput(NamedTuple):
    """A golden run and the folder with its output, which is another one whenever it is unpacked again."""

    key: str
    folder: Path


class LoadedGoldens:
    """The channels of golden runs, loaded on request. Only the last few are kept in memory."""

    def __init__(
        self,
        manifest: TargetManifest,
        folder_of: Callable[[Experiment], Path],
        *,
        several_seeds: bool = False,
        digests: Mapping[str, str] | None = None,
    ) -> None:
        self.folder_of = folder_of  # finds the output folder of the fault-free run
        self._manifest = manifest
        self._several_seeds = several_seeds
        self._digests = digests  # what `output_digest_of` must return, by key
        self._files_of_output = lru_cache(_MOST_GOLDENS_IN_MEMORY)(self._read_verified_files)
        self._trace_of_output = lru_cache(_MOST_GOLDENS_IN_MEMORY)(
            lambda output: self._load_unchanged(output, load_manifest_channels)
        )
        self._sampler_of_output = lru_cache(_MOST_GOLDENS_IN_MEMORY)(
            lambda output: SeriesSampler(manifest, self._trace_of_output(output))
        )
        self._judged_of_output = lru_cache(_MOST_GOLDENS_IN_MEMORY)(self._judge)

    def read_and_verify_files_of(self, experiment: Experiment) -> None:
        """Read the golden run's files before they are used. MutatorError if their digest is another."""
        self._files_of_output(self._output_of(experiment))

    def check_unchanged(self, experiment: Experiment) -> None:
        """Raise MutatorError if the files of a golden run have been written to since they were read."""
        self._check_output_unchanged(self._output_of(experiment))

    def _check_output_unchanged(self, output: _GoldenOutput) -> None:
        if changed := self._files_of_output(output).first_changed_path():
            raise changed_file_error(Path(changed))

    def _load_unchanged(self, output: _GoldenOutput, load: Callable[[TargetManifest, Path], _T]) -> _T:
        self._files_of_output(output)
        loaded = load(self._manifest, output.folder)
        self._check_output_unchanged(output)
        return loaded

    def _read_verified_files(self, output: _GoldenOutput) -> FileChangeDetector:
        key, folder = output
        paths = [path for name in self._manifest.output_files if (path := path_below(folder, name)).is_file()]
        files = FileChangeDetector({str(path): read_bounded(path) for path in paths})
        if self._digests is not None and output_digest_of(self._manifest, folder) != self._digests[key]:
            raise changed_file_error(folder)
        return files

    def _judge(self, output: _GoldenOutput) -> RunJudgement:
        trace = self._trace_of_output(output)
        record = self._load_unchanged(output, load_target_record)
        return judge_run(self._manifest, trace, record, golden=trace)

    def golden_key_of(self, experiment: Experiment) -> str:
        return GoldenRun.for_experiment(experiment, several_seeds=self._several_seeds).key

    def _output_of(self, experiment: Experiment) -> _GoldenOutput:
        return _GoldenOutput(self.golden_key_of(experiment), self.folder_of(experiment))

    def trace_of(self, experiment: Experiment) -> Trace:
        return self._trace_of_output(self._output_of(experiment))

    def judgement_of(self, experiment: Experiment) -> RunJudgement:
        """Return the judgement of the golden run, with the metrics that compare a run with golden, too."""
        return self._judged_of_output(self._output_of(experiment))

    def hazards_of(self, experiment: Experiment) -> HazardTimes:
        """Return the hazards of the golden run, by time."""
        return self.judgement_of(experiment).hazards_by_time

    def end_of(self, experiment: Experiment) -> GoldenEnd | None:
        """Return where a terminal hazard, or the experiment's `end_s`, ends the golden run; None if neither
        does.
        """
        ends = [end for end in (self.judgement_of(experiment).t_end, experiment.end_s) if end is not None]
        if not ends:
            return None
        times = self.trace_of(experiment)[self._manifest.time_channel]
        return GoldenEnd(rows_before=int((times < min(ends)).sum()), row_count=len(times))

    @property
    def step_s(self) -> float:
        return self._manifest.step_s

    def sampler_of(self, experiment: Experiment) -> SeriesSampler:
        return self._sampler_of_output(self._output_of(experiment))


def changed_file_error(path: Path) -> MutatorError:
    return MutatorError(
        "changed while it was in use",
        where=path,
        expected="files that no mutant writes to",
        remedy="restore it (`mutator verify` names what is damaged in a run folder), then run the same "
        "command again; `mutator run --sandbox` keeps mutants from it",
    )
