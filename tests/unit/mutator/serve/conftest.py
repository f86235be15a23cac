"""A server in this process with a toy library and a made-up run folder, and a client for any request."""

import http.client
import json
import shutil
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from mutator.report.panels import figures_panel
from mutator.serve.application import ServedSite
from mutator.serve.page_tokens import HOME_PAGE, TOKEN_HEADER, review_page_name
from mutator.serve.request_security import HOST
from mutator.serve.served_runs import ServedRuns
from mutator.serve.server import build_server, open_listener
from mutator.workspace import Workspace

from ..report.made_run import make_run

TOKEN = "a-token-that-nobody-guesses"
SECRET = "what others must not read"


@dataclass(frozen=True)
class Answer:
    status: int
    headers: Mapping[str, str]
    data: bytes

    @property
    def text(self) -> str:
        return self.data.decode("utf-8", "replace")

    @property
    def json(self) -> Any:
        return json.loads(self.data)


@dataclass(frozen=True)
class Client:
    """A client that checks that no response contains the token, the secret, or a path on the disk."""

    port: int
    place: Path
    site: ServedSite

    @property
    def origin(self) -> str:
        return f"http://{HOST}:{self.port}"

    def ask(
        self,
        method: str,
        path: str,
        headers: Mapping[str, str | None] | None = None,
        body: Any = None,
        *,
        chunked: bool = False,
    ) -> Answer:
        """Send a request as the server's page does. None in `headers` leaves a header out."""
        own: dict[str, str | None] = {"Host": f"{HOST}:{self.port}", "Cookie": f"mutator-{self.port}={TOKEN}"}
        if method == "POST":
            own |= {
                "Origin": self.origin,
                "Content-Type": "application/json",
                TOKEN_HEADER: self.token_for(path),
            }
        sent = {name: value for name, value in (own | dict(headers or {})).items() if value is not None}
        connection = http.client.HTTPConnection(HOST, self.port, timeout=60)
        try:
            connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
            data = body if isinstance(body, bytes) or body is None else json.dumps(body).encode()
            if chunked:
                sent["Transfer-Encoding"] = "chunked"
            elif data is not None and "Content-Length" not in sent:
                sent["Content-Length"] = str(len(data))
            for name, value in sent.items():
                connection.putheader(name, value)
            # the server can refuse a request before it has read all of it
            with suppress(BrokenPipeError, ConnectionResetError):
                connection.endheaders(data, encode_chunked=chunked)
            answer = connection.getresponse()
            found = Answer(answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read())
        finally:
            connection.close()
        said = found.text + str({k: v for k, v in found.headers.items() if k != "set-cookie"})
        assert TOKEN not in said
        assert SECRET not in said
        assert str(self.place) not in said
        return found

    def token_for(self, path: str) -> str:
        """The token of the page that can send any request to `path`."""
        target = path.partition("/api/review/")[2].partition("?")[0]
        return self.site.tokens.token_of(review_page_name(target) if target else HOME_PAGE)

    def get(self, path: str, **headers: str | None) -> Answer:
        return self.ask("GET", path, {name.replace("_", "-"): value for name, value in headers.items()})

    def post(self, path: str, body: Any) -> Answer:
        return self.ask("POST", path, body=body)

    def ended(self, job: str, within_s: float = 300.0) -> dict[str, Any]:
        deadline = time.monotonic() + within_s
        while time.monotonic() < deadline:
            found = next(one for one in self.get("/api/jobs").json["jobs"] if one["id"] == job)
            if found["ended"]:
                return dict(found)
            time.sleep(0.1)
        raise AssertionError(f"job {job} is still running: {found}")


@pytest.fixture(scope="session")
def served_at(_caches: Path) -> Callable[[Workspace, Path], Any]:
    @contextmanager
    def serve(workspace: Workspace, runs: Path) -> Iterator[Client]:
        site = ServedSite(workspace=workspace, runs=ServedRuns((runs,)))
        listener = open_listener(0)
        port = listener.getsockname()[1]
        server = build_server(site, port=port, token=TOKEN)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        try:
            yield Client(port, runs.parent, site)
        finally:
            server.should_exit = True
            thread.join()
            listener.close()

    return serve


@pytest.fixture(scope="module")
def client(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    served_at: Callable[[Workspace, Path], Any],
) -> Iterator[Client]:
    """A client for a server of the toy library and the made-up run `night`. The folder above the runs has a
    secret file."""
    place = tmp_path_factory.mktemp("served")
    workspace = copy_toycar(place)
    shutil.rmtree(workspace.library / "faults" / "hostile")
    (place / "secret.csv").write_text(SECRET)
    night = place / "runs" / "night"
    night.mkdir(parents=True)
    make_run(night)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            figures_panel, "draw_figures", lambda frame: ()
        )  # these take seconds and are tested elsewhere
        with served_at(workspace, place / "runs") as client:
            yield client
