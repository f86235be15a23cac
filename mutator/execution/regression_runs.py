"""Saved experiments as tests: a file of them is a bench, whose experiments pytest hands out."""

from dataclasses import replace
from functools import cached_property
from pathlib import Path

from mutator._common.cache_layout_and_pruning import campaign_runs_folder
from mutator._common.confined_files import path_below
from mutator._common.hashing import content_id
from mutator.campaigns.expectations import NO_HAZARD
from mutator.campaigns.regression_files import RegressionFile, load_regressions
from mutator.campaigns.run_inputs import RunInputs
from mutator.errors import MutatorError
from mutator.execution.bench_opening import opened_bench
from mutator.execution.campaign_runs import SessionRun
from mutator.execution.listed_items import ItemListing, list_experiments
from mutator.execution.session_items import SessionItems


class RegressionRun(SessionRun):
    """The experiments of a regression file."""

    must_reach_hazard = False  # whoever mended a fault expects none

    @cached_property
    def _file(self) -> RegressionFile:
        return load_regressions(self.path)

    def _list_items(self) -> ItemListing:
        file = self._file
        with file.source.locating_errors(("target",)):
            manifest = self._workspace.manifest(file.target)
        file.check_expectations(manifest.hazard_names, self._workspace.scale_of(manifest))
        saved = file.experiments
        numbered = list(enumerate(entry.experiment for entry in saved))
        several = True  # as all benches
        items = list_experiments(numbered, several_seeds=several, place_of=lambda fault: ("", None))
        return ItemListing(
            items=tuple(
                replace(item, place=(str(self.path), entry.line))
                for item, entry in zip(items, saved, strict=True)
            )
        )

    def _open_session(self, out: Path) -> SessionItems:
        options, file = self._options, self._file
        if options.reviewed:
            raise MutatorError(
                "--require-reviewed with saved experiments",
                where=self.path,
                remedy="leave the file out: reviews are of campaigns",
            )
        bench = self._open.enter_context(
            opened_bench(
                self._workspace,
                out,
                file.bench_values(),
                workers=max(1, options.workers),
                reuse=options.reuse,
            )
        )
        session = bench.plan([entry.experiment for entry in file.experiments], "saved experiments")
        return SessionItems(
            session=session,
            expectation=NO_HAZARD if options.hazard_fails else None,
            expectation_by_id={}
            if options.hazard_fails
            else {entry.experiment.id: entry.expectation for entry in file.experiments},
        )

    def _default_run_folder(self) -> Path:
        file = self._file
        manifest = self._workspace.manifest(file.target)
        experiments = [entry.experiment for entry in file.experiments]
        sources = self._key_of_sources(RunInputs.of_experiments(self._workspace, manifest, experiments))
        ids = [entry.experiment.id for entry in file.experiments]
        key = content_id([ids, self.path.name, *sources])
        return path_below(campaign_runs_folder(), f"regressions-{key}")
