"""A campaign in a user's pytest session: its items, and its run folder from the first item to the results."""

import warnings
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any

from mutator._common.cache_layout_and_pruning import campaign_runs_folder, prune_campaign_runs
from mutator._common.confined_files import path_below
from mutator._common.hashing import content_id
from mutator.campaigns import run_environment
from mutator.campaigns.campaign_files import load_campaign
from mutator.campaigns.expectations import NO_HAZARD, Expectation
from mutator.campaigns.plan import Plan, build_plan
from mutator.campaigns.plan_freezing import make_run_folder
from mutator.campaigns.run_inputs import RunInputs
from mutator.errors import MutatorError, MutatorWarning
from mutator.execution.campaign_items import ItemSource
from mutator.execution.finished_run_keys import harness_digest
from mutator.execution.frozen_plan import open_or_freeze_run
from mutator.execution.item_running import ItemRunner, ItemsStart
from mutator.execution.listed_items import ItemListing, list_plan
from mutator.execution.session import Session
from mutator.execution.session_items import SessionItems
from mutator.execution.session_opening import open_session
from mutator.execution.session_summary import Summary
from mutator.execution.spec_places import SpecPlaces
from mutator.results.note_on_golden_hazards import golden_hazards_note
from mutator.results.note_without_canary import no_canary_note
from mutator.results.table_reader import Results
from mutator.store import plan_file
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import ProgressCallback
from mutator.workspace import Workspace


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignOptions:
    """The options of a pytest command for its campaigns."""

    reviewed: bool = False
    accept_versions: bool = False
    reuse: bool = True
    hazard_fails: bool = False
    workers: int = 0
    packages: tuple[str, ...] = ()  # of a distributor of another package
    cluster: str | None = None  # of a run that deals its work itself
    insecure_network: bool = False


@contextmanager
def _remarks_fail_nothing() -> Iterator[None]:
    """Show remarks on a campaign also in a project whose settings make errors of warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("default", MutatorWarning)
        yield


class FileRun(ItemSource):
    """What a file asks for, in the process that is no worker. `out` is the run folder; None: in the cache."""

    must_reach_hazard = True  # whether a run without a canary shows nothing without a hazard
    deals_work = False  # whether it hands out its work itself, to a cluster too

    def __init__(
        self,
        path: Path,
        workspace: Workspace,
        options: CampaignOptions,
        *,
        out: Path | None = None,
        notify: ProgressCallback | None = None,
    ) -> None:
        super().__init__()
        self.path, self.out = path, out
        self.title = path.stem  # what summaries call it
        self._workspace, self._options, self._notify = workspace, options, notify
        self.failure: MutatorError | None = None  # why it could not begin
        self._has_begun = False

    @property
    def session(self) -> Session | None:
        """The session, once it has begun; None for one that has none."""
        return None

    @cached_property
    def listing(self) -> ItemListing:
        """All items of the file."""
        try:
            with _remarks_fail_nothing():
                return self._list_items()
        except MutatorError as err:
            return ItemListing(problem=str(err))

    @abstractmethod
    def _list_items(self) -> ItemListing: ...

    @abstractmethod
    def _begin_in(self, out: Path) -> None:
        """Open the run folder and run the checks."""

    @abstractmethod
    def _items_start(self, name: str) -> ItemsStart:
        """Return what the xdist worker `name` needs, once it has begun."""

    @abstractmethod
    def _default_run_folder(self) -> Path:
        """Return a folder below the cache for this plan of these sources: an edit of any begins a new run."""

    @abstractmethod
    def _finish(self, *, is_stopped: bool) -> Summary | None: ...

    def result_lines(self, summary: Summary) -> Sequence[str]:
        """Return what the printed summary begins with."""
        return ()

    def begin(self) -> None:
        """Open the run folder and run the checks, unless it was done; MutatorError if they fail."""
        if self.failure is not None:
            raise self.failure
        if not self._has_begun:
            try:
                self.out = self.out or self._default_run_folder()
                with _remarks_fail_nothing():
                    self._begin_in(self.out)
            except BaseException as err:
                if isinstance(err, MutatorError):
                    self.failure = err
                raise
            self._has_begun = True

    def start_for_worker(self, name: str) -> ItemsStart:
        """Return what an xdist worker needs, or why it can run nothing."""
        try:
            self.begin()
        except MutatorError as err:
            return ItemsStart(problem=str(err))
        return self._items_start(name)

    def finish(self, *, is_stopped: bool) -> Summary | None:
        """End what has begun; return its summary, None if nothing has begun. If `is_stopped`, run no more.

        A part of a campaign has no tables and no seal: these come when all experiments have a result.
        """
        if not self._has_begun or self.out is None:
            return None
        try:
            with _remarks_fail_nothing():
                return self._finish(is_stopped=is_stopped)
        finally:
            if campaign_runs_folder() in self.out.parents:
                prune_campaign_runs()

    def _key_of_sources(self, inputs: RunInputs) -> list[object]:
        """Return what decides results, beside plan and file."""
        versions = [run_environment.python_version(), run_environment.versions_of_fixed_packages()]
        return [inputs.digest_by_source(), harness_digest(), versions, self._workspace.sandbox]


class SessionRun(FileRun):
    """The experiments of a file, each an item of one session."""

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        super().__init__(*arguments, **keywords)
        self._items: SessionItems | None = None
        self._open = ExitStack()

    @property
    def session(self) -> Session | None:
        """The session, once it has begun."""
        return self._items.session if self._items else None

    @abstractmethod
    def _open_session(self, out: Path) -> SessionItems:
        """Open the run folder and run the checks; `_open` ends what was opened."""

    def _begin_in(self, out: Path) -> None:
        try:
            self._items = self._open_session(out)
        except BaseException:
            self._open.close()
            raise

    def _items_start(self, name: str) -> ItemsStart:
        assert self._items is not None
        return self._items.start_for(self._items.session.start_of_worker(name))

    def _begin(self) -> ItemRunner:
        self.begin()
        assert self._items is not None
        return self._items.start_here()

    def _finish(self, *, is_stopped: bool) -> Summary:
        assert self._items is not None
        try:
            self._items.close(self._runner, is_stopped=is_stopped)
            return self._items.session.finish(tables_of_part=False)
        finally:
            self._open.close()


class CampaignRun(SessionRun):
    """A campaign."""

    def _open_session(self, out: Path) -> SessionItems:
        options = self._options
        session = self._open.enter_context(
            open_session(
                self._workspace,
                lambda: self._open_folder(out),
                out,
                workers=options.workers,
                accept_versions=options.accept_versions,
                reuse=options.reuse,
                notify=self._notify,
            )
        )
        self._check_plan(session.folder)
        session.prepare(options.packages)
        return SessionItems(session=session, expectation=self._expectation)

    def _open_folder(self, out: Path) -> RunFolder:
        return open_or_freeze_run(self._workspace, self.path, out, Choices(), reviewed=self._options.reviewed)

    @cached_property
    def _plan(self) -> Plan:
        return build_plan(self._workspace, self.path)

    @property
    def _frozen_run(self) -> RunFolder | None:
        return RunFolder.open(self.out) if self.out is not None and RunFolder.exists(self.out) else None

    def _list_items(self) -> ItemListing:
        folder, places = self._frozen_run, SpecPlaces(self._workspace, load_campaign(self.path))
        if folder is not None:
            positions = folder.planned_positions()
            planned = enumerate(plan_file.iterate_experiments(folder.path))
            experiments = [(position, e) for position, e in planned if e.id in positions]
            several, digest = folder.has_seeded_goldens, folder.head.plan
            lengths: Sequence[int] = [count for _, _, count in folder.head.chunks]
        else:
            if self.out is not None and self.out.exists():
                make_run_folder(self.out)  # raises for a folder with anything else
            if places.has_operators:
                raise MutatorError(
                    "its mutants depend on golden runs, and collecting tests runs nothing",
                    where=self.path,
                    remedy=f"plan it first: mutator plan {self.path} --out DIR, then give --campaign-out=DIR",
                )
            plan = self._plan
            experiments = list(enumerate(plan.experiments))
            several, digest, lengths = len(plan.seeds) > 1, plan.digest, plan.chunks
        items = list_plan(experiments, lengths, several_seeds=several, place_of=places.place_of)
        return ItemListing(plan=digest, items=items)

    def _check_plan(self, folder: RunFolder) -> None:
        """Raise MutatorError if the plan is not the one that was collected."""
        if self.listing.plan != folder.head.plan:
            raise MutatorError(
                "the library was changed after the experiments were collected",
                where=self.path,
                remedy="run the same command again",
            )

    def result_lines(self, summary: Summary) -> Sequence[str]:
        """Return what the results table begins with."""
        if summary.results is None or self.out is None:
            return ()
        folder, frame = RunFolder.open(self.out), Results(self.out).frame()
        return [no_canary_note(folder, frame), golden_hazards_note(folder, frame)]

    @property
    def _expectation(self) -> Expectation | None:
        return NO_HAZARD if self._options.hazard_fails else load_campaign(self.path).expectation

    def _default_run_folder(self) -> Path:
        plan = self._plan
        manifest = self._workspace.manifest(plan.campaign.target)
        sources = self._key_of_sources(RunInputs.of_plan(self._workspace, manifest, plan.tally))
        defences = [self._workspace.defence(name).digest for name in chain(*plan.campaign.defence_sets)]
        key = content_id([plan.digest, plan.campaign.file_bytes.decode(), *sources, *defences])
        return path_below(campaign_runs_folder(), f"{plan.campaign.name}-{key}")
