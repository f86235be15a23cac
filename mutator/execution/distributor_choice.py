"""Distribute a session's pending work to processes.

`--cluster` chooses how: a module in `distributors/`, or another package's (entry points of the group
`mutator.distributors`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from mutator._common.extension_doors import DISTRIBUTOR_DOOR
from mutator.errors import MutatorError
from mutator.execution.local_distributor import LocalDistributor
from mutator.execution.session import Session

_DEFAULT_DISTRIBUTOR = "dask"


class Distributor(Protocol):
    """Distributes the pieces of a prepared session until none is left, or the session must stop.

    When `run` returns, finished work is in the run folder, and `session.written` has what each closed worker
    wrote: other lines are set aside. If `run` ends early, it sets `session.problem` or
    `session.interrupted`.
    """

    def run(self, session: Session) -> None: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class DistributorKind:
    """A way to distribute work.

    `open(where, insecure)` makes the distributor without opening a connection; MutatorError for an unusable
    `where`, the text after `NAME:`. With `insecure`, it may use a network that others can reach.
    """

    about: str
    open: Callable[[str, bool], Distributor]


def choose_distributor(cluster: str | None = None, *, insecure: bool = False) -> Distributor:
    """Make the distributor for a cluster or, without one, for this machine. Opens no connection.

    A cluster is `NAME:WHERE` for a distributor of another package, and anything else is for Dask.
    MutatorError for an unusable cluster.
    """
    if cluster is None:
        if insecure:
            raise MutatorError(
                "no cluster",
                argument="insecure_network",
                remedy="leave out `insecure_network`: without a cluster, all work runs on this machine",
            )
        return LocalDistributor()
    name, colon, where = cluster.partition(":")
    if not (colon and DISTRIBUTOR_DOOR.has_name(name)):
        name, where = _DEFAULT_DISTRIBUTOR, cluster
    kind = DISTRIBUTOR_DOOR.load(name)
    assert isinstance(kind, DistributorKind)
    with DISTRIBUTOR_DOOR.blaming_package(name):
        opened = kind.open(where, insecure)
    return opened if name in DISTRIBUTOR_DOOR.shipped_names() else _ForeignDistributor(name, opened)


def packages_of_distributor(distributor: Distributor) -> tuple[str, ...]:
    """Return the package that adds a distributor, if the harness does not."""
    name = distributor.name if isinstance(distributor, _ForeignDistributor) else ""
    return (package,) if (package := DISTRIBUTOR_DOOR.other_package_of(name)) else ()


@dataclass(frozen=True, slots=True)
class _ForeignDistributor:
    name: str
    distributor: Distributor

    def run(self, session: Session) -> None:
        with DISTRIBUTOR_DOOR.blaming_package(self.name):
            self.distributor.run(session)
