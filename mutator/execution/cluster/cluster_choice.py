"""Parse `WHERE` of `--cluster WHERE`, and open a Dask client for it.

`WHERE` is a scheduler's address, the file that a scheduler wrote, `local:N`, or a cluster file. `parse` does
not import Dask.
"""

import json
import re
import tempfile
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from mutator._common.bounded_reading import MOST_JSON_BYTES, read_bounded
from mutator.errors import MutatorError
from mutator.execution.cluster.cluster_files import load_cluster
from mutator.execution.cluster.dask_connections import (
    checked_address,
    connected,
    importing,
    is_closed,
    own_scheduler,
    refused,
)

if TYPE_CHECKING:
    from distributed import Client

_LOCAL = re.compile(r"local:(\d{1,4})")


class Where(Protocol):
    """A usable cluster. `open` returns an asynchronous Dask client and needs a running event loop.

    On exit, `open` ends what it started; an existing scheduler keeps running. Raises MutatorError if the
    cluster does not exist or its extra is not installed, and, unless `insecure`, if others on the network can
    reach the cluster.
    """

    def open(self, *, insecure: bool) -> AbstractAsyncContextManager["Client"]: ...


def parse(text: str) -> Where:
    """Parse `WHERE`; MutatorError for an invalid text or file."""
    if "://" in text:
        return Scheduler(address=checked_address(text))
    if match := _LOCAL.fullmatch(text):
        return Local(workers=_counted(int(match[1])))
    suffix = Path(text).suffix.lower()
    if suffix == ".json":
        return _scheduler_file(Path(text))
    if suffix in (".yaml", ".yml"):
        return load_cluster(Path(text))
    raise MutatorError(
        f"'{text}'",
        argument="cluster",
        expected="the address of a Dask scheduler (tls://HOST:PORT), its scheduler file (FILE.json), "
        "local:N for N workers on this machine, or a cluster file (FILE.yaml)",
    )


def _counted(workers: int) -> int:
    if workers:
        return workers
    raise MutatorError("local:0", argument="cluster", expected="at least one worker", remedy="write local:2")


def _scheduler_file(path: Path) -> "Scheduler":
    remedy = "start `dask scheduler --scheduler-file FILE` first, then give FILE"
    try:
        content = json.loads(read_bounded(path, MOST_JSON_BYTES))
        address = content["address"]
    except OSError as error:
        raise MutatorError(f"cannot be read ({error.strerror})", where=path, remedy=remedy) from None
    except (ValueError, TypeError, KeyError, RecursionError):
        raise MutatorError(
            "not a scheduler file", where=path, expected="JSON with an address", remedy=remedy
        ) from None
    return Scheduler(address=checked_address(str(address), where=path), file=path)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scheduler:
    """A running scheduler. `file` is the file from which its address was read."""

    address: str
    file: Path | None = None

    @asynccontextmanager
    async def open(self, *, insecure: bool) -> AsyncIterator["Client"]:
        if not insecure and not is_closed(self.address):
            raise refused(self.address, where=self.file)
        with importing("cluster"):
            import distributed  # noqa: F401
        async with connected(self.address, where=self.file) as client:
            listens = str(client.scheduler_info()["address"])
            if not insecure and not is_closed(listens):
                raise refused(f"{self.address} (a scheduler that listens at {listens})", where=self.file)
            yield client


@dataclass(frozen=True, slots=True, kw_only=True)
class Local:
    """Single-threaded worker processes on this machine, with their own scheduler."""

    workers: int

    @asynccontextmanager
    async def open(self, *, insecure: bool) -> AsyncIterator["Client"]:
        with importing("cluster"):
            from distributed import LocalCluster
        with (
            tempfile.TemporaryDirectory(prefix="mutator-workers-", ignore_cleanup_errors=True) as folder,
            own_scheduler(),
        ):
            cluster: Any = LocalCluster(
                n_workers=self.workers,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                local_directory=folder,
                asynchronous=True,
            )
            try:
                await cluster
                async with connected(cluster) as client:
                    yield client
            finally:
                await cluster.close()
