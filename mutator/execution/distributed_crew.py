"""The crew of a bench on a cluster: a distributor deals what waits, once a record is asked for."""

from collections import deque
from collections.abc import Callable, Iterable, Set
from typing import TYPE_CHECKING

from mutator.campaigns.chunks import chunks_with
from mutator.execution.bench_crew import CrewBatch, crew_error
from mutator.execution.progress_reporting import reporting_progress
from mutator.execution.session import Session
from mutator.execution.staying_distributor import StayingDistributor
from mutator.model import Record
from mutator.preflight.equivalence_check import SampledExperiment
from mutator.store.records import PROOF_FOLDER, RECORDS_FOLDER

if TYPE_CHECKING:
    from mutator.execution.distributor_choice import Distributor


class DistributedCrew:
    """Runs batches by a distributor, whose workers stay between batches if it can keep them.

    Nothing runs until a record is asked for: then all batches that wait are dealt together. So nothing is
    written into the run folder while its plan grows, and Ctrl-C reaches the distributor. `session_of` returns
    the session of the bench, and `on_record` gets each record.
    """

    def __init__(
        self,
        distributor: "Distributor",
        size: int,
        session_of: Callable[[], Session],
        on_record: Callable[[Record], None],
    ) -> None:
        self.size = size  # processes for the checks, which run on this machine
        self._distributor, self._session_of, self._on_record = distributor, session_of, on_record
        self._waiting: list[CrewBatch] = []
        self._arrived: deque[Record] = deque()
        self._is_stopped = False
        self._staying = distributor if isinstance(distributor, StayingDistributor) else None
        if self._staying:
            self._staying.stay_open()

    def hand_out(self, batch: CrewBatch) -> None:
        """Let a batch wait for its distribution. MutatorError once the crew was stopped."""
        if self._is_stopped:
            raise crew_error("the bench was closed")
        self._waiting.append(batch)

    def receive(self) -> Record:
        """Return the next record. MutatorError if the distributor could not finish, and KeyboardInterrupt if
        it was interrupted.
        """
        if not self._arrived:
            self._distribute()
        return self._arrived.popleft()

    def wait_until_ready(self) -> None:
        """Nothing reads the run folder between two calls."""

    def use_new_limits(self) -> None:
        """Leave it to the distributor to give its workers the limits of the run folder."""

    def stop(self) -> None:
        """Accept no more. What another thread has distributed comes to its end."""
        self._is_stopped = True

    def close(self) -> None:
        """End the workers."""
        if self._staying:
            self._staying.close()

    def kill(self) -> None:
        """Forget what waits, and end the workers. Finished lines stay."""
        self._waiting.clear()
        self._arrived.clear()
        self.close()

    def _distribute(self) -> None:
        batches, self._waiting = self._waiting, []
        for is_proof in (False, True):
            ids = [e.id for batch in batches if batch.is_proof is is_proof for run in batch.runs for e in run]
            if ids:
                self._arrived += self._records_of(ids, is_proof=is_proof)

    def _records_of(self, ids: Iterable[str], *, is_proof: bool) -> list[Record]:
        unique_ids = dict.fromkeys(ids)
        problem = self._run_session(unique_ids.keys(), is_proof=is_proof)
        stored = self._session_of().folder.records(PROOF_FOLDER if is_proof else RECORDS_FOLDER)
        missing = [name for name in unique_ids if name not in stored]
        if problem or missing:
            raise crew_error(problem or f"no result of experiment {missing[0]}")
        records = [stored[name] for name in unique_ids]
        for record in records:
            self._on_record(record)
        return records

    def _run_session(self, ids: Set[str], *, is_proof: bool) -> str:
        """Let the distributor deal these experiments; return its problem, empty if it had none."""
        session = self._session_of()
        if is_proof:
            session.proof = tuple(SampledExperiment(number, name) for number, name in enumerate(ids))
        else:
            session.pending = chunks_with(session.folder, ids)
        try:
            with reporting_progress(session):
                self._distributor.run(session)
            if session.interrupted:
                raise KeyboardInterrupt
            return session.problem
        finally:  # the bench can be used further
            session.pending, session.proof = (), ()
            session.problem, session.interrupted = "", False
