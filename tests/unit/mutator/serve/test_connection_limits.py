"""Connections that nobody uses do not stop the server."""

import http.client
import resource
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest

from mutator.serve import connection_limits
from mutator.serve.request_security import HOST

from .conftest import TOKEN, Client

SERVER = """
import resource, sys
from pathlib import Path
from mutator.serve.application import ServedSite
from mutator.serve.served_runs import ServedRuns
from mutator.serve.server import serve
from mutator.workspace import Workspace
resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))
place = Path(sys.argv[1])
site = ServedSite(workspace=Workspace.find(place), runs=ServedRuns((place,)))
serve(site, port=0, on_ready=lambda address: print(address, flush=True))
"""
UNFINISHED = ["", "GET / HTTP/1.1\r\nHost: ", "POST /api/jobs HTTP/1.1\r\nContent-Length: 9\r\n{headers}\r\n"]


@pytest.fixture
def low_limit(client: Client) -> Iterator[int]:
    """The port of a server that can open 64 descriptors."""
    words = [sys.executable, "-c", SERVER, str(client.place / "toy")]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert process.stdout is not None
    try:
        yield int(process.stdout.readline().partition(f"{HOST}:")[2].partition("/")[0])
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def answers(port: int, within_s: float) -> bool:
    """Whether the server answers, if only that there is no token."""
    deadline = time.monotonic() + within_s
    while time.monotonic() < deadline:
        connection = http.client.HTTPConnection(HOST, port, timeout=2)
        try:
            connection.request("GET", "/")
            return connection.getresponse().status == 403
        except OSError:
            time.sleep(0.05)
        finally:
            connection.close()
    return False


def ended(connection: socket.socket) -> bool:
    """Whether the server ends the connection before its time limit."""
    try:
        return connection.recv(1) == b""
    except TimeoutError:
        return False
    except ConnectionResetError:
        return True


@pytest.mark.slow
@pytest.mark.parametrize("sent", UNFINISHED)
def test_hundreds_of_connections_do_not_stop_the_server(low_limit: int, sent: str) -> None:
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    sockets = []
    for _ in range(min(400, most // 2)):
        one = socket.socket()
        one.setblocking(False)
        one.connect_ex((HOST, low_limit))
        sockets.append(one)
    time.sleep(0.2)
    for one in sockets:
        with suppress(OSError):
            one.send(sent.format(headers="Host: a\r\n").encode())
    assert answers(low_limit, 10.0)
    for one in sockets:
        one.close()


@pytest.mark.parametrize("sent", UNFINISHED)
def test_a_request_that_never_arrives_is_given_up(
    client: Client, sent: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection_limits, "MOST_REQUEST_S", 0.3)
    with socket.create_connection((HOST, client.port), timeout=5) as one:
        own = {
            "Host": f"{HOST}:{client.port}",
            "Origin": client.origin,
            "Cookie": f"mutator-{client.port}={TOKEN}",
        }
        headers = "".join(f"{name}: {value}\r\n" for name, value in own.items())
        one.sendall(sent.format(headers=headers).encode())
        assert ended(one)


def test_a_long_response_is_not_given_up(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """A first report can take longer than a request may take to arrive."""
    monkeypatch.setattr(connection_limits, "MOST_REQUEST_S", 0.1)
    summarize = client.site.summarize_runs
    monkeypatch.setattr(client.site, "summarize_runs", lambda: (time.sleep(0.4), summarize())[1])
    assert client.get("/api/runs").status == 200


def test_the_oldest_idle_connection_makes_room(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection_limits, "_MOST_CONNECTIONS", 3)
    sockets = [socket.create_connection((HOST, client.port), timeout=0.2) for _ in range(6)]
    assert client.get("/api/runs").status == 200
    assert [ended(one) for one in sockets] == [True, True, True, True, False, False]
    for one in sockets:
        one.close()
