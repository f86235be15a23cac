"""Connect to Dask schedulers: allowed networks, and the errors of failed connections."""

import asyncio
import ipaddress
import os
import re
import ssl
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from mutator.errors import MutatorError

if TYPE_CHECKING:
    from distributed import Client, Security
    from distributed.deploy.cluster import Cluster

CONNECT_S = 10.0  # before a silent scheduler is given up
_ADDRESS = re.compile(
    r"(?P<protocol>tcp|tls)://(?P<host>\[[0-9a-fA-F:.]+\]|[^\s:/@\[\]]+):(?P<port>\d{1,5})/?"
)
_TO_CLOSE = (
    "whoever reaches a Dask scheduler can run code on its workers: use tls:// "
    "(docs/how-to/run-on-many-machines.md says how), or allow it with `insecure_network` where nobody else "
    "is on the network"
)


def checked_address(address: str, *, where: Path | None = None) -> str:
    """The address of a scheduler, as it is; MutatorError for what is none.

    `where` is the file that it was read from.
    """
    found = _ADDRESS.fullmatch(address)
    if found and 0 < int(found["port"]) < 2**16:
        return address
    raise MutatorError(
        f"address '{address}'",
        where=where,
        argument="cluster",
        expected="tcp://HOST:PORT or tls://HOST:PORT",
    )


def is_closed(address: str) -> bool:
    """Whether nobody else can read or join: over TLS, or on this machine only.

    Host names are not looked up; this machine's is `localhost`.
    """
    found = _ADDRESS.fullmatch(address)
    return found is not None and (found["protocol"] == "tls" or is_loopback(found["host"]))


def is_loopback(host: str) -> bool:
    """Whether a host's name or number means this machine."""
    try:
        return host == "localhost" or ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def refused(what: str, *, where: Path | None = None, line: int | None = None) -> MutatorError:
    """The error (not raised) of a network on which others can reach the scheduler."""
    return MutatorError(
        f"{what}, which is neither on the loopback nor encrypted",
        where=where,
        line=line,
        argument="cluster",
        remedy=_TO_CLOSE,
    )


@contextmanager
def importing(extra: str) -> Iterator[None]:
    """Turn the error of a missing package into one that names its extra."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise MutatorError(
            f"no package {error.name}",
            argument="cluster",
            remedy=f"pip install '.[{extra}]' in a clone; of a wheel: pip install 'FILE.whl[{extra}]'",
        ) from None


@contextmanager
def own_scheduler() -> Iterator[None]:
    """Dask settings for a scheduler in this process.

    A frozen worker is noticed within a minute, Dask does not spend CPU time on watching its threads, and the
    dashboard's link is for this machine only, the only one it answers.
    """
    import dask

    settings = {
        "distributed.scheduler.worker-ttl": "60s",
        "distributed.worker.profile.enabled": False,
        "distributed.admin.tick.interval": "500ms",
        "distributed.dashboard.link": "{scheme}://127.0.0.1:{port}/status",
    }
    with dask.config.set(settings):
        yield


def certificates() -> "Security":
    """TLS from Dask's configuration (`distributed.comm.tls`); MutatorError unless it is usable."""
    from distributed import Security

    remedy = (
        "name the certificates in Dask's configuration, as DASK_DISTRIBUTED__COMM__TLS__CA_FILE, "
        "..__CLIENT__CERT and ..__CLIENT__KEY (docs/how-to/run-on-many-machines.md)"
    )
    try:
        security = Security()
        context = security.get_connection_args("client")["ssl_context"]
    except (OSError, ssl.SSLError) as error:
        raise MutatorError(
            f"no use of the TLS certificates: {error}", argument="cluster", remedy=remedy
        ) from None
    if context is None:
        raise MutatorError("tls:// without certificates", argument="cluster", remedy=remedy)
    return security


@asynccontextmanager
async def connected(to: "str | Cluster", *, where: Path | None = None) -> AsyncIterator["Client"]:
    """An asynchronous client of a scheduler or cluster; MutatorError if it does not answer in time."""
    from distributed import Client

    address = to if isinstance(to, str) else to.scheduler_address
    security = certificates() if isinstance(to, str) and to.startswith("tls://") else None
    client = Client(
        to, asynchronous=True, set_as_default=False, timeout=CONNECT_S, security=security, name="mutator"
    )
    try:
        try:
            async with asyncio.timeout(CONNECT_S + 2):
                await client
        except (
            OSError,
            TimeoutError,
            ssl.SSLError,
        ) as error:  # Dask's own connection errors are OSErrors
            raise MutatorError(
                f"no Dask scheduler answers at {address}{await _reason(address, error)}",
                where=where,
                argument="cluster",
                remedy="start it (`dask scheduler`), or check address, firewall and certificates",
            ) from None
        yield client
    finally:
        await client.close()


async def _reason(address: str, error: BaseException) -> str:
    """The reason, from the innermost error, since Dask only reports how long it tried.

    If its last try was cut short, that error says nothing, and one more try is made.
    """
    while error.__cause__ is not None:
        error = error.__cause__
    if str(error):
        return f" ({error})"
    if found := _ADDRESS.fullmatch(address):
        try:
            async with asyncio.timeout(5.0):
                _, writer = await asyncio.open_connection(found["host"].strip("[]"), int(found["port"]))
                writer.close()
        except OSError as tried:
            return f" ({os.strerror(tried.errno)})" if tried.errno else ""
    return ""
