"""How the pending work of a session is dealt out to processes: one interface, one module for each way."""

from pkgutil import resolve_name
from typing import Protocol

from mutator.errors import MutatorError
from mutator.execution.cluster.connecting import importing
from mutator.execution.cluster.where import parse
from mutator.execution.local import LocalWorkers
from mutator.execution.session import Session

_DASK = "mutator.execution.cluster.dask_workers:ClusterWorkers"


class Distributor(Protocol):
    """Deals out the pieces of a prepared session until none is left, or the session must stop.

    What finished is in the run folder by then: its workers appended it, or it did so itself. What ends the
    session early goes to `session.problem` and `session.interrupted`; nothing that finished is lost.
    """

    def run(self, session: Session) -> None: ...


def distributor(cluster: str | None = None, *, insecure: bool = False) -> Distributor:
    """The way to deal out work to a cluster, or without one to this machine; MutatorError for an unusable
    cluster, or one whose packages are not installed. Nothing is started or connected."""
    if cluster is None:
        if insecure:
            raise MutatorError(
                "no cluster", argument="insecure_network", remedy="leave it out: all stays on this machine"
            )
        return LocalWorkers()
    where = parse(cluster)
    with importing("cluster"):  # an extra: imported only when it is asked for
        deals: Distributor = resolve_name(_DASK)(where, insecure=insecure)
    return deals
