"""Connections that are idle, send nothing or read nothing do not use up the descriptors of the server.

uvicorn ends a connection that waits too long for its next request. This adds a limit for the first request
and for the arrival of a whole request, and a limit for the number of connections.
"""

import asyncio
import resource
from typing import Any, cast

from uvicorn.protocols.http.h11_impl import H11Protocol

REQUEST_S = 10.0  # time for a whole request to arrive
_MOST = 100  # connections; a browser opens six
_SHARE = 4  # connections use at most this fraction of the descriptors


class Connection(H11Protocol):
    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._since = self.loop.time()
        self._limit: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._expect_request()
        others = [cast(Connection, one) for one in self.connections if one is not self]
        others = [one for one in others if not one.transport.is_closing()]
        if len(others) >= _most_connections():
            min(others, key=lambda one: (one._is_answering, one._since)).transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        super().connection_lost(exc)
        if self._limit:
            self._limit.cancel()

    def on_response_complete(self) -> None:
        self._expect_request()  # first, because the next request can already be here
        super().on_response_complete()

    @property
    def _is_answering(self) -> bool:
        """Whether a request has arrived and its response is not complete."""
        cycle = self.cycle
        return cycle is not None and not cycle.response_complete and not cycle.more_body

    def _expect_request(self) -> None:
        if self._limit:
            self._limit.cancel()
        self._limit = self.loop.call_later(REQUEST_S, self._end_if_idle)

    def _end_if_idle(self) -> None:
        if not self._is_answering:
            self.transport.abort()


def _most_connections() -> int:
    return min(_MOST, resource.getrlimit(resource.RLIMIT_NOFILE)[0] // _SHARE)
