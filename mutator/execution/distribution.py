"""Distribute a session's pending work to processes."""

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

    When `run` returns, finished work is in the run folder, and `session.written` has what each closed worker
    wrote: other lines are set aside. If `run` ends early, it sets `session.problem` or
    `session.interrupted`.
    """

    def run(self, session: Session) -> None: ...


def distributor(cluster: str | None = None, *, insecure: bool = False) -> Distributor:
    """Make the distributor for a cluster or, without one, for this machine. Opens no connection.

    MutatorError for an unusable cluster.
    """
    if cluster is None:
        if insecure:
            raise MutatorError(
                "no cluster",
                argument="insecure_network",
                remedy="leave out `insecure_network`: without a cluster, all work runs on this machine",
            )
        return LocalWorkers()
    where = parse(cluster)
    with importing("cluster"):  # imported only on request, because the package is optional
        deals: Distributor = resolve_name(_DASK)(where, insecure=insecure)
    return deals
