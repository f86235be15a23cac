"""The server itself: a socket of the loopback interface, a token, and the end of all jobs with it."""

import secrets
import socket
from collections.abc import Callable

import uvicorn

from mutator.errors import MutatorError
from mutator.serve.app import Site, application
from mutator.serve.security import HOST, Guarded


def serve(site: Site, *, port: int, ready: Callable[[str], None]) -> None:
    """Serve a site until the process is asked to end; `ready` is called with its address, token included.

    `port` 0: any that is free. MutatorError for one that is taken.
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
    """What answers on a port to who has the token."""
    config = uvicorn.Config(
        Guarded(application(site), port=port, token=token),
        access_log=False,  # the token is in the first address
        log_level="error",
        ws="none",
        server_header=False,
        proxy_headers=False,
        timeout_graceful_shutdown=2,
    )
    return uvicorn.Server(config)


def listening(port: int) -> socket.socket:
    """A socket of this machine that nobody else reaches; MutatorError for a port that is taken."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
    except OSError as err:
        listener.close()
        raise MutatorError(
            f"port {port} cannot be used ({err.strerror})", argument="port", remedy="choose another, or none"
        ) from None
    listener.listen()
    return listener
