"""Connections that are idle, send nothing or read nothing do not use up the descriptors of the server.

uvicorn ends a connection that waits too long for its next request. This adds a limit for the first request
and for the arrival of a whole request, and a limit for the number of connections.
"""

import asyncio
import resource
from typing import Any, cast

from uvicorn.protocols.http.h11_impl import H11Protocol

MOST_REQUEST_S = 10.0  # time for a whole request to arrive
_MOST_CONNECTIONS = 100  # connections; a browser opens six
_DESCRIPTORS_PER_CONNECTION = 4  # the others are for files of runs, pipes of jobs and caches


class LimitedConnection(H11Protocol):
    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._opened_at = self.loop.time()
        self._request_timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._expect_request()
        others = [cast(LimitedConnection, other) for other in self.connections if other is not self]
        others = [other for other in others if not other.transport.is_closing()]
        if len(others) >= _most_connections():
            min(others, key=lambda other: (other._is_answering, other._opened_at)).transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        super().connection_lost(exc)
        if self._request_timer:
            self._request_timer.cancel()

    def on_response_complete(self) -> None:
        self._expect_request()  # first, because the next request can already be here
        super().on_response_complete()

    @property
    def _is_answering(self) -> bool:
        """Whether a request has arrived and its response is not complete."""
        cycle = self.cycle
        return cycle is not None and not cycle.response_complete and not cycle.more_body

    def _expect_request(self) -> None:
        if self._request_timer:
            self._request_timer.cancel()
        self._request_timer = self.loop.call_later(MOST_REQUEST_S, self._end_if_idle)

    def _end_if_idle(self) -> None:
        if not self._is_answering:
            self.transport.abort()


def _most_connections() -> int:
    return min(
        _MOST_CONNECTIONS, resource.getrlimit(resource.RLIMIT_NOFILE)[0] // _DESCRIPTORS_PER_CONNECTION
    )
