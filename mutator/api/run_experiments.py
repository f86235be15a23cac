"""An experiment of a run folder: its traces, patch, fault path and rerun."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mutator._common.argument_checks import check_whole_number
from mutator._common.confined_files import path_below
from mutator._common.files import ScratchFolder
from mutator._common.library_and_run_folder_search import shrunk_folder
from mutator.api.experiment_results import TraceFrames, trace_frame
from mutator.api.run_contents import RunContents
from mutator.api.smallest_form import SmallestForm
from mutator.api.stored_experiments import StoredExperiment
from mutator.api.trials import Trial, build_trial
from mutator.engines.engine_choice import check_engine_is_offered
from mutator.errors import MutatorError
from mutator.execution.single_run import rerun_experiment
from mutator.outcomes.series_sampling import write_sampled_series
from mutator.outcomes.trace_and_record_loading import Trace, load_trace
from mutator.report.experiment_filming import ExperimentFilmer, Shot
from mutator.store.run_progress import ProgressCallback


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class RunExperiment(StoredExperiment):
    """An experiment of a run."""

    run: RunContents  #: the run that it belongs to

    def traces(self, *, exact: bool = False) -> TraceFrames:
        """Return the golden and the faulty run as pandas frames.

        By default, they are the experiment's series: the manifest's channels, at most 20 values a second (10
        for the controller's beliefs), to six digits, so short events can be missing. With `exact`, the
        experiment is rerun, and the frames have all channels in every step. An experiment without a series is
        also rerun, and its series is then kept.

        MutatorError if the experiment has not run. For a rerun, MutatorError if the target, templates or
        scenario have changed, or if the result differs from the campaign's.
        """
        if exact:
            trial = self.rerun(keep=True)
            if trial.same_as_record is False:  # None: there is no record to compare with
                raise MutatorError(
                    f"the rerun of {self.id} differs from the campaign's record", where=self.run.path
                )
            return trial.traces()
        if self.record is None:
            raise self.not_run_error()
        golden, faulty = self.run.traces.sampled_traces_of(self.id, rerun_if_missing=True)
        manifest = self._manifest()
        return TraceFrames(golden=trace_frame(golden, manifest), faulty=trace_frame(faulty, manifest))

    def rerun(self, *, keep: bool = False) -> Trial:
        """Rerun the experiment; `Trial.same_as_record` says whether the record equals the campaign's.

        With `keep`, the trace, series and plot stay in the run folder. MutatorError if the target, templates
        or scenario have changed.
        """
        run, folder = self.run, self.run.folder
        temporary = None if keep else ScratchFolder("mutator-rerun-")
        out = path_below(temporary.path, self.id) if temporary else None
        single, is_same = rerun_experiment(run.workspace, folder.path, self.id, out=out)
        manifest = run.manifest
        trial = build_trial(
            single,
            manifest,
            scale=self.scale,
            phrases=run.folder.head.phrases,
            same_as_record=is_same if self.record else None,
            temporary=temporary,
        )
        if (
            keep and trial.save_plot(self.plot_file) and is_same
        ):  # keep a series only if it matches the record
            golden, faulty = (
                load_trace(manifest, run_folder) for run_folder in (single.golden, single.faulty)
            )
            write_sampled_series(folder.path, manifest, golden, faulty, single.record)
        return trial

    def shrink(
        self,
        out: str | Path | None = None,
        *,
        start: bool = False,
        workers: int = 1,
        engine: str | None = None,
        progress: ProgressCallback | None = None,
    ) -> SmallestForm:
        """Find the smallest form of the fault that has the same hazard, the experiment's first.

        Tried are a shorter fault, a simpler scenario (one that the campaign lists before), one injection
        instead of several and a smaller value; with `start`, also a rounder start. The forms are driven on a
        bench in the run folder `out`; default: in `shrunk/` beside this run. The same call goes on after an
        interruption. `workers`: number of processes; `engine`, `progress`: as for `run`.

        MutatorError for an experiment without a hazard, for an unfinished run, and if the target, templates,
        scenario or spec have changed. CheckFailed if the smallest form differs on the reference engine.
        """
        check_whole_number("workers", workers, least=1)
        check_engine_is_offered(engine)
        if self.record is None:
            raise self.not_run_error()
        folder = shrunk_folder(self.run.path.resolve(), self.id)
        from mutator.api.shrinks import Shrinker

        shrinker = Shrinker(self.run, self.experiment, self.record, start)
        return shrinker.shrink(
            Path(out) if out is not None else folder, workers=workers, engine=engine, notify=progress
        )

    def film(self, shots: Sequence[Shot]) -> bool:
        """Rerun the golden and the faulty run, write videos or stills, and return whether the record equals
        the campaign's.

        MutatorError for a target that cannot be filmed, and for a faulty run that left no film.
        """
        return ExperimentFilmer.of(self.run.workspace, self.run.folder).rerun_and_write_shots(
            self.experiment, self.record, shots
        )

    def _load_traces(self) -> tuple[Trace, Trace]:
        if self.record is None:
            raise self.not_run_error()
        return self.run.traces.traces_of(self.id)
