"""Connect to Dask schedulers: which networks are allowed, and why a connection failed."""

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

CONNECT_S = 10.0  # wait before giving up on a silent scheduler
_ADDRESS = re.compile(
    r"(?P<protocol>tcp|tls)://(?P<host>\[[0-9a-fA-F:.]+\]|[^\s:/@\[\]]+):(?P<port>\d{1,5})/?"
)
_TO_CLOSE = (
    "anyone who can reach a Dask scheduler can run code on its workers: use tls:// "
    "(see docs/how-to/run-on-many-machines.md), or give `insecure_network` if nobody else is on "
    "the network"
)


def checked_address(address: str, *, where: Path | None = None) -> str:
    """Return the scheduler's address unchanged; MutatorError if it is invalid.

    `where` is the file from which the address was read.
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
    """Return whether TLS, or an address on this machine, prevents others from connecting or eavesdropping.

    Host names except `localhost` are not looked up.
    """
    found = _ADDRESS.fullmatch(address)
    return found is not None and (found["protocol"] == "tls" or is_loopback(found["host"]))


def is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def refused(what: str, *, where: Path | None = None, line: int | None = None) -> MutatorError:
    """Make the error for a network on which others can reach the scheduler."""
    return MutatorError(
        f"{what} is neither encrypted nor on the loopback interface",
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
            f"the package {error.name} is not installed",
            argument="cluster",
            remedy=f"pip install '.[{extra}]' in a clone, or pip install 'FILE.whl[{extra}]'",
        ) from None


@contextmanager
def own_scheduler() -> Iterator[None]:
    """Apply Dask settings for a scheduler in this process.

    A frozen worker is noticed within a minute. Dask does not profile its threads, which saves CPU time. The
    link to the dashboard uses the only address on which the dashboard answers. Processes that Dask starts
    import nothing from their working folder.
    """
    import dask

    settings = {
        "distributed.scheduler.worker-ttl": "60s",
        "distributed.worker.profile.enabled": False,
        "distributed.admin.tick.interval": "500ms",
        "distributed.dashboard.link": "{scheme}://127.0.0.1:{port}/status",
    }
    before = os.environ.get("PYTHONSAFEPATH")
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        with dask.config.set(settings):
            yield
    finally:
        os.environ.pop("PYTHONSAFEPATH")
        if before is not None:
            os.environ["PYTHONSAFEPATH"] = before


def certificates() -> "Security":
    """Return the TLS settings of Dask's configuration (`distributed.comm.tls`); MutatorError if unusable."""
    from distributed import Security

    remedy = (
        "name the certificates in Dask's configuration: DASK_DISTRIBUTED__COMM__TLS__CA_FILE, "
        "..__CLIENT__CERT and ..__CLIENT__KEY (docs/how-to/run-on-many-machines.md)"
    )
    try:
        security = Security()
        context = security.get_connection_args("client")["ssl_context"]
    except (OSError, ssl.SSLError) as error:
        raise MutatorError(f"unusable TLS certificates: {error}", argument="cluster", remedy=remedy) from None
    if context is None:
        raise MutatorError("tls:// without certificates", argument="cluster", remedy=remedy)
    return security


@asynccontextmanager
async def connected(to: "str | Cluster", *, where: Path | None = None) -> AsyncIterator["Client"]:
    """Connect an asynchronous client to a scheduler or cluster; MutatorError after a time limit."""
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
                remedy="start one (`dask scheduler`), or check address, firewall and certificates",
            ) from None
        yield client
    finally:
        await client.close()


async def _reason(address: str, error: BaseException) -> str:
    """Return the reason for a failed connection from the innermost error.

    If that error says nothing, because Dask's last attempt was cut short, make one more attempt.
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
