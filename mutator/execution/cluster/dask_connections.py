"""Connect to Dask schedulers: which networks are allowed, and why a connection failed."""

import asyncio
import ipaddress
import os
import re
import ssl
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractContextManager, asynccontextmanager, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from mutator._common.version import extra_install_command
from mutator.errors import MutatorError

if TYPE_CHECKING:
    from distributed import Client, Security
    from distributed.deploy.cluster import Cluster

CONNECT_TIMEOUT_S = 10.0  # wait before giving up on a silent scheduler
_ADDRESS_PATTERN = re.compile(
    r"(?P<protocol>tcp|tls)://(?P<host>\[[0-9a-fA-F:.]+\]|[^\s:/@\[\]]+):(?P<port>\d{1,5})/?"
)
_REMEDY_FOR_OPEN_NETWORK = (
    "anyone who can reach a Dask scheduler can run code on its workers: use tls:// "
    "(see docs/how-to/run-on-many-machines.md), or give `insecure_network` if nobody else is on "
    "the network"
)


def checked_address(address: str, *, where: Path | None = None) -> str:
    """Return the scheduler's address unchanged; MutatorError if it is invalid.

    `where` is the file from which the address was read.
    """
    match = _ADDRESS_PATTERN.fullmatch(address)
    if match and 0 < int(match["port"]) < 2**16:
        return address
    raise MutatorError(
        f"address '{address}'",
        where=where,
        argument="cluster",
        expected="tcp://HOST:PORT or tls://HOST:PORT",
    )


def is_closed_to_others(address: str) -> bool:
    """Return whether TLS, or an address on this machine, prevents others from connecting or eavesdropping.

    Host names except `localhost` are not looked up.
    """
    match = _ADDRESS_PATTERN.fullmatch(address)
    return match is not None and (match["protocol"] == "tls" or is_loopback(match["host"]))


def is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def open_network_error(network: str, *, where: Path | None = None, line: int | None = None) -> MutatorError:
    """Make the error for a network on which others can reach the scheduler."""
    return MutatorError(
        f"{network} is neither encrypted nor on the loopback interface",
        where=where,
        line=line,
        argument="cluster",
        remedy=_REMEDY_FOR_OPEN_NETWORK,
    )


@contextmanager
def requiring_extra(extra: str) -> Iterator[None]:
    """Turn the error of a missing package into one that names its extra."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise MutatorError(
            f"the package {error.name} is not installed",
            argument="cluster",
            remedy=extra_install_command(extra),
        ) from None


class _SharedContext:
    """A context of the whole process: it begins with its first user and ends with its last, in any order."""

    def __init__(self, make: Callable[[], AbstractContextManager[None]]) -> None:
        self._make, self._lock = make, threading.Lock()
        self._user_count = 0
        self._context: AbstractContextManager[None] = nullcontext()

    @contextmanager
    def use(self) -> Iterator[None]:
        with self._lock:
            if not self._user_count:
                self._context = self._make()
                self._context.__enter__()
            self._user_count += 1
        try:
            yield
        finally:
            with self._lock:
                self._user_count -= 1
                if not self._user_count:
                    self._context.__exit__(None, None, None)


@contextmanager
def _setting_dask_up() -> Iterator[None]:
    import dask

    settings = {
        "distributed.scheduler.worker-ttl": "60s",
        "distributed.worker.profile.enabled": False,
        "distributed.admin.tick.interval": "500ms",
        "distributed.dashboard.link": "{scheme}://127.0.0.1:{port}/status",
    }
    with dask.config.set(settings):
        yield


@contextmanager
def _setting_safe_path() -> Iterator[None]:
    before = os.environ.get("PYTHONSAFEPATH")
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        yield
    finally:
        os.environ.pop("PYTHONSAFEPATH")
        if before is not None:
            os.environ["PYTHONSAFEPATH"] = before


_scheduler_settings, _safe_path = _SharedContext(_setting_dask_up), _SharedContext(_setting_safe_path)


def applying_scheduler_settings() -> AbstractContextManager[None]:
    """Apply Dask settings for a scheduler in this process, as long as it is open.

    A frozen worker is noticed within a minute. Dask does not profile its threads, which saves CPU time. The
    link to the dashboard uses the only address on which the dashboard answers.
    """
    return _scheduler_settings.use()


def starting_processes_safely() -> AbstractContextManager[None]:
    """Let processes that Dask starts meanwhile import nothing from their working folder."""
    return _safe_path.use()


def safe_nanny_class() -> type:
    """Make the class of what starts local workers, and replaces those that die, even while a bench waits."""
    from distributed import Nanny, Status

    class SafeNanny(Nanny):
        async def instantiate(self) -> Status:
            with starting_processes_safely():
                return await super().instantiate()

    return SafeNanny


def load_tls_certificates() -> "Security":
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
async def connected_client(
    scheduler_or_cluster: "str | Cluster", *, where: Path | None = None
) -> AsyncIterator["Client"]:
    """Connect an asynchronous client to a scheduler or cluster; MutatorError after a time limit."""
    from distributed import Client

    address = (
        scheduler_or_cluster
        if isinstance(scheduler_or_cluster, str)
        else scheduler_or_cluster.scheduler_address
    )
    security = (
        load_tls_certificates()
        if isinstance(scheduler_or_cluster, str) and scheduler_or_cluster.startswith("tls://")
        else None
    )
    client = Client(
        scheduler_or_cluster,
        asynchronous=True,
        set_as_default=False,
        timeout=CONNECT_TIMEOUT_S,
        security=security,
        name="mutator",
    )
    try:
        try:
            async with asyncio.timeout(CONNECT_TIMEOUT_S + 2):  # after Dask's own, whose error says more
                await client
        except (
            OSError,
            TimeoutError,
            ssl.SSLError,
        ) as error:  # Dask's own connection errors are OSErrors
            raise MutatorError(
                f"no Dask scheduler answers at {address}{await _describe_failed_connection(address, error)}",
                where=where,
                argument="cluster",
                remedy="start one (`dask scheduler`), or check address, firewall and certificates",
            ) from None
        yield client
    finally:
        await client.close()


async def _describe_failed_connection(address: str, error: BaseException) -> str:
    """Return the reason for a failed connection from the innermost error.

    If that error says nothing, because Dask's last attempt was cut short, make one more attempt.
    """
    while error.__cause__ is not None:
        error = error.__cause__
    if str(error):
        return f" ({error})"
    if match := _ADDRESS_PATTERN.fullmatch(address):
        try:
            async with asyncio.timeout(5.0):
                _, writer = await asyncio.open_connection(match["host"].strip("[]"), int(match["port"]))
                writer.close()
        except OSError as tried:
            return f" ({os.strerror(tried.errno)})" if tried.errno else ""
    return ""
