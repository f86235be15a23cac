"""Hostile pages, from another origin or in a run folder, cannot attack a server."""

import json
import shutil
import threading
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import pytest

from mutator.workspace import Workspace

HACKED = "globalThis.hacked = true"


@pytest.fixture
def address(
    run: Path, tmp_path: Path, copy_toycar: Callable[[Path], Workspace], serve: Callable[..., Any]
) -> Iterator[str]:
    shutil.copytree(run, tmp_path / "runs" / "night")
    with serve(copy_toycar(tmp_path), (tmp_path / "runs",)) as found:
        yield found


@pytest.mark.slow
def test_a_served_report_works(address: str, visit: Callable[..., Any], run: Path, tmp_path: Path) -> None:
    """The server's policy allows the report's scripts, styles and series."""
    series = json.loads((tmp_path / "runs/night/plan/experiments.jsonl").read_text().splitlines()[1])
    page = visit(address, f"/runs/night/report/index.html#e={series['id']}")
    page.wait_for_selector("html[data-ready]", state="attached")
    page.wait_for_selector("#experiment canvas")
    assert page.evaluate("getComputedStyle(document.querySelector('.tiles')).display") != "block"


def test_a_plot_opened_directly_runs_no_script(address: str, browser: Any, tmp_path: Path) -> None:
    plots = tmp_path / "runs/night/plots"
    plots.mkdir(exist_ok=True)
    (plots / "a.svg").write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" onload="{HACKED}"><script>{HACKED}</script></svg>'
    )
    context = browser.new_context()
    page = context.new_page()
    page.goto(address)
    page.goto(f"{address.partition('/?')[0]}/runs/night/plots/a.svg")
    assert page.evaluate("document.documentElement.localName") == "svg"
    assert page.evaluate("globalThis.hacked") is None
    context.close()


ATTACK = """async (made) => {
    const said = [];
    const options = { credentials: "include" };
    for (const more of [{}, { mode: "no-cors" }]) {
        await fetch(`${made}/api/jobs`, { ...options, ...more })
            .then(async (answer) => said.push(await answer.text()), () => said.push("refused"));
        await fetch(`${made}/api/review/toycar`, { ...options, ...more, method: "POST", body: "{}" })
            .then(async (answer) => said.push(await answer.text()), () => said.push("refused"));
    }
    const element = async (name, set) => new Promise((resolve) => {
        const made = Object.assign(document.createElement(name), set);
        made.onload = () => resolve("loaded");
        made.onerror = () => resolve("refused");
        document.body.append(made);
    });
    said.push(await element("script", { src: `${made}/assets/shared/dom.js` }));
    said.push(await element("img", { src: `${made}/runs/night/plots/picture.png` }));
    return said;
}"""
PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010802000000907753de0000000c49444154789c63606060000000040001f61738550000000049454e44ae426082"
)


class _Foreign(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<title>foreign</title><body></body>")

    def log_message(self, *words: object) -> None:
        pass


def test_a_page_of_another_origin_reads_nothing(address: str, browser: Any, tmp_path: Path) -> None:
    picture = tmp_path / "runs/night/plots/picture.png"
    picture.parent.mkdir(exist_ok=True)
    picture.write_bytes(PIXEL)
    made = address.partition("/?")[0]
    foreign = HTTPServer(("127.0.0.1", 0), _Foreign)
    threading.Thread(target=foreign.serve_forever, daemon=True).start()
    context = browser.new_context()
    try:
        page = context.new_page()
        page.goto(address)
        assert "Runs" in page.content()
        page.goto(f"http://127.0.0.1:{foreign.server_port}/")
        said = page.evaluate(ATTACK, made)
        assert set(said) <= {"refused", ""}, said
        assert "loaded" not in said
        page.set_content(f"<iframe src='{made}/'></iframe>")
        page.wait_for_timeout(300)
        assert not [frame for frame in page.frames[1:] if "Runs and reviews" in frame.content()]
    finally:
        context.close()
        foreign.shutdown()
        foreign.server_close()
