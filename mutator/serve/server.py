"""The server: a socket on the loopback interface, and a token."""

import secrets
import socket
from collections.abc import Callable

import uvicorn

from mutator.errors import MutatorError
from mutator.serve.application import ServedSite, build_application
from mutator.serve.connection_limits import LimitedConnection
from mutator.serve.request_security import HOST, GuardedApplication

_BACKLOG = 64  # connections to accept at once


def serve(site: ServedSite, *, port: int, on_ready: Callable[[str], None]) -> None:
    """Serve a site until the process is interrupted, then end all jobs; `on_ready` is called with the address
    and token.

    `port` 0 means any free port. MutatorError for a port in use.
    """
    token = secrets.token_urlsafe(32)
    with open_listener(port) as listener:
        bound_port = listener.getsockname()[1]
        server = build_server(site, port=bound_port, token=token)
        on_ready(f"http://{HOST}:{bound_port}/?token={token}")
        try:
            server.run(sockets=[listener])
        finally:
            site.jobs.close()


def build_server(site: ServedSite, *, port: int, token: str) -> uvicorn.Server:
    config = uvicorn.Config(
        GuardedApplication(build_application(site), port=port, token=token),
        http=LimitedConnection,
        backlog=_BACKLOG,
        access_log=False,  # the log would show the token
        log_level="error",
        ws="none",
        server_header=False,
        proxy_headers=False,
        timeout_graceful_shutdown=2,  # s; an open page must not delay Ctrl-C
    )
    return uvicorn.Server(config)


def open_listener(port: int) -> socket.socket:
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
