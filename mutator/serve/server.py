"""The server: a socket on the loopback interface, and a token."""

import secrets
import socket
from collections.abc import Callable

import uvicorn

from mutator.errors import MutatorError
from mutator.serve.application import Site, build_application
from mutator.serve.connections import Connection
from mutator.serve.security import HOST, Guarded

_BACKLOG = 64  # connections to accept at once


def serve(site: Site, *, port: int, ready: Callable[[str], None]) -> None:
    """Serve a site until the process is interrupted, then end all jobs; `ready` is called with the address
    and token.

    `port` 0 means any free port. MutatorError for a port in use.
    """
    token = secrets.token_urlsafe(32)
    with listening(port) as listener:
        own = listener.getsockname()[1]
        server = server_of(site, port=own, token=token)
        ready(f"http://{HOST}:{own}/?token={token}")
        try:
            server.run(sockets=[listener])
        finally:
            site.jobs.close()


def server_of(site: Site, *, port: int, token: str) -> uvicorn.Server:
    config = uvicorn.Config(
        Guarded(build_application(site), port=port, token=token),
        http=Connection,
        backlog=_BACKLOG,
        access_log=False,  # the log would show the token
        log_level="error",
        ws="none",
        server_header=False,
        proxy_headers=False,
        timeout_graceful_shutdown=2,
    )
    return uvicorn.Server(config)


def listening(port: int) -> socket.socket:
    """Open a socket that only this machine can reach; MutatorError for a port in use."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
    except OSError as err:
        listener.close()
        raise MutatorError(
            f"cannot use port {port} ({err.strerror})",
            argument="port",
            remedy="choose another port, or leave out `port`",
        ) from None
    listener.listen()
    return listener
