"""Call functions on a worker through Dask."""

import asyncio
import uuid
import warnings
from collections.abc import Callable
from typing import Any, TypeVar, cast

from distributed import Client, Future
from distributed.client import FutureCancelledError
from distributed.scheduler import KilledWorker

from mutator.errors import MutatorError, WorkerCutOff, WorkerRefused

_T = TypeVar("_T")


def submit_to_worker(
    client: Client, address: str, function: Callable[..., _T], *arguments: Any
) -> "Future[_T]":
    """Submit a function to the worker at this address, and to no other."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Sending large graph")  # a bundle is sent to each worker only once
        return client.submit(
            function,
            *arguments,
            key=f"mutator-{function.__name__}-{uuid.uuid4().hex}",
            workers=[address],
            allow_other_workers=False,
            pure=False,
            retries=0,
        )


async def call_on_worker(client: Client, address: str, function: Callable[..., _T], *arguments: Any) -> _T:
    future = submit_to_worker(client, address, function, *arguments)
    try:
        return await await_answer(future)
    finally:
        future.release()


async def await_answer(future: "Future[_T]") -> _T:
    """Return the result of a task. WorkerRefused if it raises, WorkerCutOff if the scheduler dropped it.

    If the worker is dead, this never returns.
    """
    try:
        return cast("_T", await future)
    except KilledWorker:
        await asyncio.Event().wait()  # the worker is gone; other code notices that
        raise
    except FutureCancelledError:
        raise WorkerCutOff("the scheduler dropped the worker's tasks") from None
    except MutatorError as err:
        raise WorkerRefused(str(err)) from None
    except Exception as err:
        raise WorkerRefused(f"{type(err).__name__}: {err}") from None
