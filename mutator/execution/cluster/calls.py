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
    """A worker gets no work, or no more of it."""


class Cut(Refused):
    """The scheduler lost the command for a moment, and dropped all that it had from it."""


def submit(client: Client, address: str, function: Callable[..., _T], *arguments: Any) -> "Future[_T]":
    """Have the worker at this address call a function, and no other."""
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
    """As `answer`, of a function that is called now."""
    future = submit(client, address, function, *arguments)
    try:
        return await answer(future)
    finally:
        future.release()


async def answer(future: "Future[_T]") -> _T:
    """What a task returns. Refused for what it raises, Cut when nobody is to answer any more; a worker that
    dies does not answer."""
    try:
        return cast("_T", await future)
    except KilledWorker:
        await asyncio.Event().wait()  # the worker is gone, which is seen elsewhere
        raise
    except FutureCancelledError:
        raise Cut("the scheduler dropped its work") from None
    except MutatorError as err:
        raise Refused(str(err)) from None
    except Exception as err:
        raise Refused(f"{type(err).__name__}: {err}") from None
