"""The work of a session as items of pytest."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from mutator.campaigns.expectations import Expectation
from mutator.errors import MutatorError
from mutator.execution.item_running import FinishedItems, ItemRunner, ItemsStart
from mutator.execution.listed_items import (
    MOST_SINGLE_ITEMS,
    ItemListing,
    list_chunks,
    list_selected,
    place_in_run_folder,
    positions_in_plan,
)
from mutator.execution.session import Session
from mutator.execution.worker import Worker, WorkerStart
from mutator.preflight import equivalence_check
from mutator.workspace import Workspace


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionItems:
    """A prepared session, whose experiments are items. `expectation` is what all results may be, unless
    `expectation_by_id` has another one for an experiment.
    """

    session: Session
    expectation: Expectation | None = None
    expectation_by_id: Mapping[str, Expectation] = field(default_factory=dict)

    def list_work(self) -> ItemListing:
        """List what the session has to do: experiments without a record, and those to prove."""
        session, folder = self.session, self.session.folder
        pending = self._pending_positions()
        if len(pending) > MOST_SINGLE_ITEMS:
            items = list_chunks(folder, session.pending)
        else:
            positions = folder.planned_positions() if session.proof else {}
            to_prove = (positions[sample.id] for sample in session.proof)
            items = list_selected(folder, [*pending, *to_prove], place_in_run_folder(folder))
        return ItemListing(plan=folder.head.plan, items=items)

    def start_for(self, worker: WorkerStart | None) -> ItemsStart:
        """Return what a process needs to run the items; `worker` is None for this process."""
        session = self.session
        timings = session.folder.timings() if session.proof else {}
        return ItemsStart(
            worker=worker,
            pending=frozenset(self._pending_positions()),
            unproved=frozenset(sample.id for sample in session.proof),
            has_forked=any(map(equivalence_check.was_forked, timings.values())),
            expectation=self.expectation,
            expectation_by_id=self.expectation_by_id,
            replay_options=options_of_workspace(session.workspace),
        )

    def start_here(self) -> ItemRunner:
        """Return the runner of this process."""
        session = self.session
        assignment = session.worker_assignment("main")
        return ItemRunner(session.folder, self.start_for(None), lambda: Worker(session.inputs, assignment))

    def close(self, runner: ItemRunner | FinishedItems | None, *, is_stopped: bool) -> None:
        """End the runner of this process, if it has begun; if `is_stopped`, without what remains to prove."""
        if isinstance(runner, ItemRunner):
            if not is_stopped:
                runner.prove_rest()
            self.session.written.add_report(runner.close())

    def _pending_positions(self) -> list[int]:
        chunks = positions_in_plan(self.session.folder, self.session.pending)
        return [position for positions in chunks.values() for position in positions]


def options_of_workspace(workspace: Workspace) -> tuple[str, ...]:
    """Return the options with which `mutator` finds this workspace, if it is called in the current folder."""
    options: list[str] = []
    try:
        default: Workspace | None = Workspace.find()
    except MutatorError:
        default = None
    for name in ("library", "templates", "target"):
        folder = getattr(workspace, name)
        if folder is not None and (default is None or folder != getattr(default, name)):
            options += [f"--{name}", str(folder)]
    return (*options, "--sandbox") if workspace.sandbox else tuple(options)
