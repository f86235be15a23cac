"""Functions called on a worker by Dask."""

import asyncio
import uuid
import warnings
from collections.abc import Callable
from typing import Any, TypeVar, cast

from distributed import Client, Future
from distributed.client import FutureCancelledError
from distributed.scheduler import KilledWorker

from mutator.errors import MutatorError

_T = TypeVar("_T")


class Refused(Exception):
    """A worker gets no work, or no more."""


class Cut(Refused):
    """The scheduler briefly lost the command, and dropped all its tasks."""


def submit(client: Client, address: str, function: Callable[..., _T], *arguments: Any) -> "Future[_T]":
    """Make exactly the worker at this address call a function."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Sending large graph")  # a bundle goes to each worker once
        return client.submit(
            function,
            *arguments,
            key=f"mutator-{function.__name__}-{uuid.uuid4().hex}",
            workers=[address],
            allow_other_workers=False,
            pure=False,
            retries=0,
        )


async def call(client: Client, address: str, function: Callable[..., _T], *arguments: Any) -> _T:
    """Call a function on a worker now; as `answer`."""
    future = submit(client, address, function, *arguments)
    try:
        return await answer(future)
    finally:
        future.release()


async def answer(future: "Future[_T]") -> _T:
    """The result of a task. Refused if it raises, Cut if nobody will answer; a dead worker never answers."""
    try:
        return cast("_T", await future)
    except KilledWorker:
        await asyncio.Event().wait()  # the worker is gone, which is noticed elsewhere
        raise
    except FutureCancelledError:
        raise Cut("the scheduler dropped its work") from None
    except MutatorError as err:
        raise Refused(str(err)) from None
    except Exception as err:
        raise Refused(f"{type(err).__name__}: {err}") from None
