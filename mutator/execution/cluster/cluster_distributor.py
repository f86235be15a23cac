"""The distributor of `mutator run --cluster`. It runs Dask in a separate thread."""

import asyncio
import queue
import threading
import warnings
from collections.abc import Callable
from contextlib import suppress

from mutator.errors import MutatorWarning
from mutator.execution.cluster.cluster_choice import ClusterChoice
from mutator.execution.cluster.cluster_files import ClusterFile
from mutator.execution.cluster.work_dispatcher import WorkDispatcher
from mutator.execution.session import Session

_REMARK_CHECK_INTERVAL_S = 0.5  # between two checks for remarks


class ClusterDistributor:
    def __init__(self, cluster_choice: ClusterChoice, *, insecure: bool = False) -> None:
        self._cluster_choice, self._is_insecure = cluster_choice, insecure

    def run(self, session: Session) -> None:
        """Distribute the pending work in another thread, while this one waits and can receive signals."""
        remarks: queue.Queue[str] = queue.Queue()
        loop = asyncio.new_event_loop()
        dispatch = loop.create_task(self._dispatch(session, remarks.put))
        # no join: in CPython 3.11 and 3.12 a thread is marked as ended once Ctrl-C interrupts its join
        loop_ended = threading.Event()
        thread = threading.Thread(target=_run_event_loop, args=(loop, dispatch, loop_ended), name="cluster")
        thread.start()
        try:
            while not loop_ended.wait(_REMARK_CHECK_INTERVAL_S) or not remarks.empty():
                while not remarks.empty():
                    warnings.warn(remarks.get(), MutatorWarning, stacklevel=2)
        except BaseException as err:
            with suppress(RuntimeError):  # the loop has just closed
                loop.call_soon_threadsafe(dispatch.cancel)
            loop_ended.wait()
            if not isinstance(err, KeyboardInterrupt):  # a warning that is raised as an error
                raise
            session.interrupted = True
        if not dispatch.cancelled() and (error := dispatch.exception()) is not None:
            raise error

    async def _dispatch(self, session: Session, remark: Callable[[str], None]) -> None:
        async with self._cluster_choice.open(insecure=self._is_insecure) as client:
            queued = (
                self._cluster_choice.model.workers if isinstance(self._cluster_choice, ClusterFile) else None
            )
            await WorkDispatcher(session, client, remark, expected_workers=queued).run()


def _run_event_loop(
    loop: asyncio.AbstractEventLoop, dispatch: "asyncio.Task[None]", loop_ended: threading.Event
) -> None:
    try:
        with suppress(BaseException):  # the code that awaits the task gets the error
            loop.run_until_complete(dispatch)
        loop.run_until_complete(loop.shutdown_asyncgens())
        loop.run_until_complete(loop.shutdown_default_executor())
        loop.close()
    finally:
        loop_ended.set()
