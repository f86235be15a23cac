"""Distribute work with Dask (extra `cluster`)."""

from pkgutil import resolve_name

from mutator.execution.cluster.cluster_choice import parse_cluster_choice
from mutator.execution.cluster.dask_connections import requiring_extra
from mutator.execution.distributor_choice import Distributor, DistributorKind

_DISTRIBUTOR_CLASS = "mutator.execution.cluster.cluster_distributor:ClusterDistributor"


def _open_cluster(where: str, insecure: bool) -> Distributor:
    cluster_choice = parse_cluster_choice(where)
    with requiring_extra("cluster"):  # imported only on request, because the package is optional
        distributor: Distributor = resolve_name(_DISTRIBUTOR_CLASS)(cluster_choice, insecure=insecure)
    return distributor


DISTRIBUTOR = DistributorKind(
    about="the workers of a Dask scheduler, of a cluster file, or N new ones on this machine (`local:N`)",
    open=_open_cluster,
)
