"""How long a session's cluster stays open, and what ends its work."""

import asyncio
import threading
import warnings
from collections.abc import Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest

from mutator.errors import MutatorError, MutatorWarning
from mutator.execution.cluster import cluster_distributor
from mutator.execution.cluster.cluster_distributor import ClusterDistributor


def test_an_error_in_a_remark_ends_the_work(session: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    class Place:
        @asynccontextmanager
        async def open(self, *, insecure: bool):  # type: ignore[no-untyped-def]
            yield None

    class Remarking:
        def __init__(self, session: Any, client: Any, remark: Callable[[str], None], **more: Any) -> None:
            self._remark = remark

        async def run(self) -> None:
            self._remark("something")
            await asyncio.sleep(60.0)

    monkeypatch.setattr(cluster_distributor, "WorkDispatcher", Remarking)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(MutatorWarning, match="something"):
            ClusterDistributor(Place()).run(session)
    assert not [thread for thread in threading.enumerate() if thread.name == "cluster" and thread.is_alive()]


class CountedPlace:
    """A cluster that counts how often it was opened and closed."""

    def __init__(self) -> None:
        self.opened, self.closed = 0, 0

    @asynccontextmanager
    async def open(self, *, insecure: bool):  # type: ignore[no-untyped-def]
        self.opened += 1
        try:
            yield None
        finally:
            self.closed += 1


def test_a_cluster_stays_open_until_it_is_closed(session: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """By default it is opened for each session; kept open, it is closed by a problem, an error, or at the
    end. The next session opens another.
    """
    ends: list[Any] = []

    class Ending:
        def __init__(self, *arguments: Any, **more: Any) -> None:
            pass

        async def run(self) -> None:
            end = ends.pop() if ends else ""
            if isinstance(end, Exception):
                raise end
            session.problem = end

    monkeypatch.setattr(cluster_distributor, "WorkDispatcher", Ending)
    place = CountedPlace()
    distributor = ClusterDistributor(place)
    for number in (1, 2):
        distributor.run(session)
        assert (place.opened, place.closed) == (number, number)
    distributor.stay_open()
    for _ in range(3):
        distributor.run(session)
        assert (place.opened, place.closed) == (3, 2)
    ends.append("the scheduler is gone")
    distributor.run(session)
    assert (place.opened, place.closed) == (3, 3)
    distributor.run(session)
    ends.append(MutatorError("wrong"))
    with pytest.raises(MutatorError, match="wrong"):
        distributor.run(session)
    assert (place.opened, place.closed) == (4, 4)
    distributor.run(session)
    for _ in range(2):
        distributor.close()
    assert (place.opened, place.closed) == (5, 5)
