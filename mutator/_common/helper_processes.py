"""Share work among forked processes. Results are in the order of the items."""

import gc
import os
import pickle
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from mutator._common.cpu_cores import usable_cores
from mutator.errors import MutatorError

_MOST_PROCESSES = 2  # the maximum number of processes, because each needs memory
_MIN_EXPERIMENTS_TO_SHARE = (
    20_000  # the smallest number of experiments for which a second process is worth starting
)

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")


def process_count_for(experiment_count: int) -> int:
    return min(_MOST_PROCESSES, usable_cores()) if experiment_count >= _MIN_EXPERIMENTS_TO_SHARE else 1


def map_in_processes(
    compute: Callable[[ItemT], ResultT], items: Sequence[ItemT], process_count: int
) -> Iterator[ResultT]:
    """Yield `compute(item)` for each item, in order, computed by `process_count` processes (with fewer than
    two: by this process).

    Each process is at most one result ahead, which saves memory. Exceptions that `compute` raises are raised
    again; MutatorError if a process dies.
    """
    if process_count < 2:
        yield from map(compute, items)
        return
    with _started_workers(compute, items, process_count) as receivers:
        for number in range(len(items)):
            yield _receive_result(receivers[number % process_count])


@contextmanager
def computing_in_background(
    compute: Callable[[], ResultT], process_count: int
) -> Iterator[Callable[[], ResultT]]:
    """Run `compute` in another process during the block. Yield a function that waits for its result.

    The function raises what `compute` raised. With fewer than two processes, `compute` itself is yielded.
    """
    if process_count < 2:
        yield compute
        return
    with _started_workers(lambda _: compute(), [None], 1) as [receiver]:
        yield lambda: _receive_result(receiver)


@contextmanager
def _started_workers(
    compute: Callable[[ItemT], ResultT], items: Sequence[ItemT], process_count: int
) -> Iterator[list[Connection]]:
    """Start worker processes, which end with the block, and yield the connections to their results."""
    context = get_context("fork")  # items and `compute` are inherited, and need not be pickled
    pipes = [context.Pipe(duplex=False) for _ in range(process_count)]
    workers = [
        context.Process(
            target=_send_results, args=(compute, items[number::process_count], pipes, number), daemon=True
        )
        for number in range(process_count)
    ]
    try:
        for worker in workers:
            worker.start()
        for _, sender in pipes:
            sender.close()
        yield [receiver for receiver, _ in pipes]
    finally:
        for receiver, _ in pipes:
            receiver.close()
        for worker in workers:
            if worker.pid is not None:
                worker.terminate()
                worker.join()


def _send_results(
    compute: Callable[[ItemT], Any],
    items: Sequence[ItemT],
    pipes: Sequence[tuple[Connection, Connection]],
    worker_number: int,
) -> None:
    gc.disable()  # results have no cycles, and a collection would copy shared memory
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes; the parent ends its workers
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    for receiver, _ in pipes:  # otherwise no worker would notice that the parent died
        receiver.close()
    sender = pipes[worker_number][1]
    try:
        for item in items:
            sender.send_bytes(pickle.dumps((compute(item), None), pickle.HIGHEST_PROTOCOL))
    except BrokenPipeError:
        os._exit(1)
    except BaseException as err:
        sender.send_bytes(pickle.dumps((None, err)))


def _receive_result(receiver: Connection) -> Any:
    try:
        result, error = pickle.loads(receiver.recv_bytes())
    except EOFError:
        raise MutatorError(
            "a helper process was killed",
            expected="enough memory for it",
            remedy="free some memory, then run the same command again",
        ) from None
    if error is not None:
        raise error
    return result
