"""The distributor of `--cluster`. It runs Dask in a separate thread."""

import asyncio
import queue
import threading
import warnings
from contextlib import suppress

from mutator.errors import MutatorWarning
from mutator.execution.cluster.attending_workers import AttendingWorkers
from mutator.execution.cluster.cluster_choice import ClusterChoice
from mutator.execution.cluster.cluster_files import ClusterFile
from mutator.execution.cluster.work_dispatcher import WorkDispatcher
from mutator.execution.session import Session

_REMARK_CHECK_INTERVAL_S = 0.5  # between two checks for remarks


class ClusterDistributor:
    """Distributes work to a cluster, which it opens for each session, or keeps open after `stay_open`."""

    def __init__(self, cluster_choice: ClusterChoice, *, insecure: bool = False) -> None:
        self._cluster_choice, self._is_insecure = cluster_choice, insecure
        self._open_cluster: _OpenCluster | None = None
        self._stays_open = False

    def stay_open(self) -> None:
        """From now on, leave cluster and workers open between sessions, until `close`."""
        self._stays_open = True

    def run(self, session: Session) -> None:
        """Distribute the pending work in another thread, while this one waits and can receive signals.

        After a problem, the cluster is closed in any case.
        """
        cluster = self._open_cluster or _OpenCluster(self._cluster_choice, is_insecure=self._is_insecure)
        self._open_cluster = None
        cluster.distribute(session)  # after an error, it is closed
        self._open_cluster = cluster
        if session.problem or session.interrupted or not self._stays_open:
            self.close()

    def close(self) -> None:
        """End client, workers and, if it was started here, the cluster."""
        cluster, self._open_cluster = self._open_cluster, None
        if cluster is not None:
            cluster.close()


class _OpenCluster:
    """A cluster with its client, in the event loop of a thread, which waits for sessions."""

    def __init__(self, cluster_choice: ClusterChoice, *, is_insecure: bool) -> None:
        self._cluster_choice, self._is_insecure = cluster_choice, is_insecure
        self._remarks: queue.Queue[str] = queue.Queue()
        self._sessions: asyncio.Queue[Session] = asyncio.Queue()
        self._has_settled = threading.Event()  # the work of a session is done, or the loop has ended
        # no join: in CPython 3.11 and 3.12 a thread is marked as ended once Ctrl-C interrupts its join
        self._has_ended = threading.Event()
        self._loop = asyncio.new_event_loop()
        self._serving = self._loop.create_task(self._serve_sessions())
        # a bench that is never closed does not keep the interpreter from its end
        threading.Thread(target=self._run_event_loop, name="cluster", daemon=True).start()

    def distribute(self, session: Session) -> None:
        """Wait until the session's work is done. Ctrl-C interrupts the session, and closes the cluster, like
        any error.
        """
        self._has_settled.clear()
        if self._has_ended.is_set():
            self._has_settled.set()
        try:
            with suppress(RuntimeError):  # the loop has just closed
                self._loop.call_soon_threadsafe(self._sessions.put_nowait, session)
            while not self._has_settled.wait(_REMARK_CHECK_INTERVAL_S) or not self._remarks.empty():
                while not self._remarks.empty():
                    warnings.warn(self._remarks.get(), MutatorWarning, stacklevel=3)
        except BaseException as err:
            self.close()
            if not isinstance(err, KeyboardInterrupt):  # a warning that is raised as an error
                raise
            session.interrupted = True
        if self._has_ended.is_set():
            self.close()

    def close(self) -> None:
        """End all; raise what ended the loop before, or went wrong now."""
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._serving.cancel)
        self._has_ended.wait()
        if not self._serving.cancelled() and (error := self._serving.exception()) is not None:
            raise error

    async def _serve_sessions(self) -> None:
        async with self._cluster_choice.open(insecure=self._is_insecure) as client:
            queued = (
                self._cluster_choice.model.workers if isinstance(self._cluster_choice, ClusterFile) else None
            )
            attending = AttendingWorkers(client)
            try:
                while True:
                    session = await self._sessions.get()
                    remark = self._remarks.put
                    await WorkDispatcher(session, attending, remark, expected_workers=queued).run()
                    self._has_settled.set()
            finally:
                await attending.dismiss()

    def _run_event_loop(self) -> None:
        loop = self._loop
        try:
            with suppress(BaseException):  # whoever waits gets the error
                loop.run_until_complete(self._serving)
            loop.run_until_complete(loop.shutdown_asyncgens())
            loop.run_until_complete(loop.shutdown_default_executor())
            loop.close()
        finally:
            self._has_ended.set()
            self._has_settled.set()
