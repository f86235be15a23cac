"""Distribute a session's pending work to processes: one interface, one module for each way."""

from pkgutil import resolve_name
from typing import Protocol

from mutator.errors import MutatorError
from mutator.execution.cluster.connecting import importing
from mutator.execution.cluster.where import parse
from mutator.execution.local import LocalWorkers
from mutator.execution.session import Session

_DASK = "mutator.execution.cluster.dask_workers:ClusterWorkers"


class Distributor(Protocol):
    """Distributes the pieces of a prepared session until none is left, or the session must stop.

    Finished work is in the run folder by then, appended by the workers or by the distributor. What ends the
    session early goes to `session.problem` and `session.interrupted`.
    """

    def run(self, session: Session) -> None: ...


def distributor(cluster: str | None = None, *, insecure: bool = False) -> Distributor:
    """The distributor for a cluster, or without one for this machine; MutatorError for an unusable cluster.

    Nothing is started or connected.
    """
    if cluster is None:
        if insecure:
            raise MutatorError(
                "no cluster",
                argument="insecure_network",
                remedy="leave it out: without a cluster, all stays here",
            )
        return LocalWorkers()
    where = parse(cluster)
    with importing("cluster"):  # an optional package: imported only on request
        deals: Distributor = resolve_name(_DASK)(where, insecure=insecure)
    return deals
