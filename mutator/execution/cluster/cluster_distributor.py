"""The distributor of `mutator run --cluster`. It runs Dask in a separate thread."""

import asyncio
import queue
import threading
import warnings
from collections.abc import Callable
from contextlib import suppress

from mutator.errors import MutatorWarning
from mutator.execution.cluster.cluster_choice import Where
from mutator.execution.cluster.cluster_files import ClusterFile
from mutator.execution.cluster.work_dispatcher import Deal
from mutator.execution.session import Session

_LOOK_S = 0.5  # between two checks for remarks


class ClusterWorkers:
    def __init__(self, where: Where, *, insecure: bool = False) -> None:
        self._where, self._insecure = where, insecure

    def run(self, session: Session) -> None:
        """Distribute the pending work in another thread, while this one waits and can receive signals."""
        remarks: queue.Queue[str] = queue.Queue()
        loop = asyncio.new_event_loop()
        deal = loop.create_task(self._deal(session, remarks.put))
        # no join: in CPython 3.11 and 3.12 a thread is marked as ended once Ctrl-C interrupts its join
        over = threading.Event()
        thread = threading.Thread(target=_run, args=(loop, deal, over), name="cluster")
        thread.start()
        try:
            while not over.wait(_LOOK_S) or not remarks.empty():
                while not remarks.empty():
                    warnings.warn(remarks.get(), MutatorWarning, stacklevel=2)
        except BaseException as err:
            with suppress(RuntimeError):  # the loop has just closed
                loop.call_soon_threadsafe(deal.cancel)
            over.wait()
            if not isinstance(err, KeyboardInterrupt):  # a warning that is raised as an error
                raise
            session.interrupted = True
        if not deal.cancelled() and (error := deal.exception()) is not None:
            raise error

    async def _deal(self, session: Session, remark: Callable[[str], None]) -> None:
        async with self._where.open(insecure=self._insecure) as client:
            queued = self._where.model.workers if isinstance(self._where, ClusterFile) else None
            await Deal(session, client, remark, queued=queued).run()


def _run(loop: asyncio.AbstractEventLoop, deal: "asyncio.Task[None]", over: threading.Event) -> None:
    try:
        with suppress(BaseException):  # the code that awaits the task gets the error
            loop.run_until_complete(deal)
        loop.run_until_complete(loop.shutdown_asyncgens())
        loop.run_until_complete(loop.shutdown_default_executor())
        loop.close()
    finally:
        over.set()
