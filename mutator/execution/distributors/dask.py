"""Distribute work with Dask (extra `cluster`)."""

from pkgutil import resolve_name

from mutator.execution.cluster.cluster_choice import parse
from mutator.execution.cluster.dask_connections import importing
from mutator.execution.distribution import Distributor, DistributorKind

_WORKERS = "mutator.execution.cluster.cluster_distributor:ClusterWorkers"


def _open(where: str, insecure: bool) -> Distributor:
    place = parse(where)
    with importing("cluster"):  # imported only on request, because the package is optional
        workers: Distributor = resolve_name(_WORKERS)(place, insecure=insecure)
    return workers


DISTRIBUTOR = DistributorKind(
    about="the workers of a Dask scheduler, of a cluster file, or N new ones on this machine (`local:N`)",
    open=_open,
)
