"""Parse `WHERE` of `--cluster WHERE`, and open a Dask client for it.

`WHERE` is a scheduler's address, the file that a scheduler wrote, `local:N`, or a cluster file.
`parse_cluster_choice` does not import Dask.
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
from mutator.execution.cluster.cluster_files import load_cluster_file
from mutator.execution.cluster.dask_connections import (
    applying_scheduler_settings,
    checked_address,
    connected_client,
    is_closed_to_others,
    open_network_error,
    requiring_extra,
    safe_nanny_class,
)

if TYPE_CHECKING:
    from distributed import Client

_LOCAL_PATTERN = re.compile(r"local:(\d{1,4})")


class ClusterChoice(Protocol):
    """A usable cluster. `open` returns an asynchronous Dask client and needs a running event loop.

    On exit, `open` ends what it started; an existing scheduler keeps running. Raises MutatorError if the
    cluster does not exist or its extra is not installed, and, unless `insecure`, if others on the network can
    reach the cluster.
    """

    def open(self, *, insecure: bool) -> AbstractAsyncContextManager["Client"]: ...


def parse_cluster_choice(text: str) -> ClusterChoice:
    """Parse `WHERE`; MutatorError for an invalid text or file."""
    if "://" in text:
        return RunningScheduler(address=checked_address(text))
    if match := _LOCAL_PATTERN.fullmatch(text):
        return NewLocalCluster(worker_count=_checked_worker_count(int(match[1])))
    suffix = Path(text).suffix.lower()
    if suffix == ".json":
        return _load_scheduler_file(Path(text))
    if suffix in (".yaml", ".yml"):
        return load_cluster_file(Path(text))
    raise MutatorError(
        f"'{text}'",
        argument="cluster",
        expected="the address of a Dask scheduler (tls://HOST:PORT), its scheduler file (FILE.json), "
        "local:N for N workers on this machine, or a cluster file (FILE.yaml)",
    )


def _checked_worker_count(worker_count: int) -> int:
    if worker_count:
        return worker_count
    raise MutatorError("local:0", argument="cluster", expected="at least one worker", remedy="write local:2")


def _load_scheduler_file(path: Path) -> "RunningScheduler":
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
    return RunningScheduler(address=checked_address(str(address), where=path), address_file=path)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunningScheduler:
    """A running scheduler. `address_file` is the file from which its address was read."""

    address: str
    address_file: Path | None = None

    @asynccontextmanager
    async def open(self, *, insecure: bool) -> AsyncIterator["Client"]:
        if not insecure and not is_closed_to_others(self.address):
            raise open_network_error(self.address, where=self.address_file)
        with requiring_extra("cluster"):
            import distributed  # noqa: F401
        async with connected_client(self.address, where=self.address_file) as client:
            listens = str(client.scheduler_info()["address"])
            if not insecure and not is_closed_to_others(listens):
                raise open_network_error(
                    f"{self.address} (a scheduler that listens at {listens})", where=self.address_file
                )
            yield client


@dataclass(frozen=True, slots=True, kw_only=True)
class NewLocalCluster:
    """Single-threaded worker processes on this machine, with their own scheduler."""

    worker_count: int

    @asynccontextmanager
    async def open(self, *, insecure: bool) -> AsyncIterator["Client"]:
        with requiring_extra("cluster"):
            from distributed import LocalCluster
        with (
            tempfile.TemporaryDirectory(prefix="mutator-workers-", ignore_cleanup_errors=True) as folder,
            applying_scheduler_settings(),
        ):
            cluster: Any = LocalCluster(
                n_workers=self.worker_count,
                threads_per_worker=1,
                worker_class=safe_nanny_class(),
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                local_directory=folder,
                asynchronous=True,
            )
            try:
                await cluster
                async with connected_client(cluster) as client:
                    yield client
            finally:
                await cluster.close()
