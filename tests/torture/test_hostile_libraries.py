"""Whatever a stranger's library contains, nothing outside it is read, written, deleted or run."""

import asyncio
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator.campaigns.plans import Choices
from mutator.errors import MutatorError
from mutator.execution.cluster.bundle import Bundle, lay_out
from mutator.execution.session import open_session
from mutator.serve.app import Site, application
from mutator.serve.runs import Runs

from .hostile_libraries import SECRET, TRICKS, World
from .readers import cli

LONGEST_S = 60  # of one command, on a busy machine
QUICK: dict[str, tuple[object, ...]] = {  # commands that run no target
    "list": ("list",),
    "doctor": ("doctor",),
    "plan": ("plan", "toy", "--out", "OUT"),
    "diff": ("diff", "sensor/lane"),
    "places": ("places", "toycar/sensing.py"),
    "generate": ("generate", "sensor/*", "--trees", "--out", "OUT"),
    "review": ("review", "list"),
    "review page": ("review", "page", "--out", "OUT/page.html"),
    "approve": ("review", "approve", "--only", "spec ~ lane", "--by", "Jane Doe", "--yes"),
    "pictures": ("review", "show", "0", "--pictures", "OUT"),
    "stpa": ("stpa", "--svg", "OUT/analysis.svg"),
    "upgrade": ("upgrade", "fault_library/targets/toycar.yaml"),
    "init": ("init", "OUT", "--target", "tree"),
}
SLOW: dict[str, tuple[object, ...]] = {
    "check": ("check",),
    "check --drive": ("check", "--drive", "--scenario", "A"),
    "try": ("try", "sensor/lane", "--scenario", "A", "--trigger", "near"),
    "operators": (
        "generate",
        "--operators",
        "branch",
        "--in",
        "toycar/**",
        "--scenario",
        "A",
        "--out",
        "OUT",
    ),
    "run": ("run", "toy", "--out", "OUT", "--limit", "2", "-n", "0"),
    "run again": ("run", "toy", "--out", "OUT", "--limit", "2", "-n", "0"),
    "report": ("report", "OUT"),
    "verify": ("verify", "OUT"),
    "rerun": ("rerun", "OUT", "0"),
    "export": ("export", "OUT", "--format", "csv"),
}
ADDRESSES = (
    "/api/library",
    "/",
    "/review/toycar",
    "/review/toycar?spec=sensor/*",
    "/api/review/toycar?campaign=toy",
    "/review/..%2F..%2F..%2Fmine%2Ftoycar",
    "/api/review/%2Ftmp%2Fx",
)


class TooLong(BaseException):
    """No handler of the harness catches it."""


@contextmanager
def at_most(seconds: int) -> Iterator[None]:
    def end(*_: object) -> None:
        raise TooLong

    before = signal.signal(signal.SIGALRM, end)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.fixture
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> World:
    for name in ("ROOT", "LIBRARY", "TEMPLATES", "TARGET"):
        monkeypatch.delenv(f"MUTATOR_{name}", raising=False)
    world = World.build(tmp_path)
    monkeypatch.chdir(world.got)
    return world


def problems(
    world: World, what: str, act: Callable[[], tuple[int, str]], *, without: str | None = None
) -> list[str]:
    """What went wrong in a command that may write to `out` and to one folder of the library."""
    before, found = world.state(without=without), []
    try:
        with at_most(LONGEST_S):
            code, said = act()
    except TooLong:
        return [f"{what}: still running after {LONGEST_S} s"]
    except BaseException as error:
        return [f"{what}: {error!r}"]
    if code not in range(4):
        found.append(f"{what}: exit code {code}")
    if "Traceback" in said or "defect in mutator" in said:
        found.append(f"{what}: {said[-1500:]}")
    if SECRET in said:
        found.append(f"{what}: shows the secret: {said[-500:]}")
    if (after := world.state(without=without)) != before:
        changed = [path for path in {*before, *after} if before.get(path) != after.get(path)]
        found.append(f"{what}: changed {changed}")
    return found + [f"{what}: wrote the secret to {path}" for path in world.leaks()]


def command(world: World, words: tuple[object, ...], number: int) -> tuple[int, str]:
    code, out, err = cli(*(str(word).replace("OUT", str(world.out / str(number))) for word in words))
    return code, out + err


def asked(world: World, address: str) -> tuple[int, str]:
    """Send a request to the application of `serve` in this process."""
    path, _, query = address.partition("?")
    said: list[bytes] = []
    scope = {
        "type": "http", "asgi": {"version": "3.0"}, "http_version": "1.1", "method": "GET", "scheme": "http",
        "path": path, "raw_path": path.encode(), "query_string": query.encode(), "headers": [],
        "server": ("127.0.0.1", 1), "client": ("127.0.0.1", 2), "root_path": "",
    }  # fmt: skip

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: dict[str, Any]) -> None:
        said.append(message.get("body", b""))

    site = Site(workspace=world.workspace, runs=Runs((world.out,)))
    try:
        asyncio.run(application(site)(scope, receive, send))
    finally:
        site.jobs.close()
    return 0, b"".join(said).decode("utf-8", "replace")


def packed(world: World) -> tuple[int, str]:
    """Pack a bundle for a cluster's workers, and write it as a worker does."""
    try:
        with open_session(
            world.workspace,
            "toy",
            world.out / "session",
            workers=1,
            choices=Choices(limit=2),
            engine="reference",
        ) as session:
            session.prepare()
            data = Bundle.of(world.workspace, session.folder, "reference").data
        (world.out / "place").mkdir()
        lay_out(data, world.out / "place")
    except MutatorError as error:
        return error.exit_code, str(error)
    return 0, ""


def called(world: World) -> tuple[int, str]:
    try:
        found = mutator.load_review(workspace=world.workspace, target="toycar")
        return 0, f"{mutator.list_faults(world.workspace)} {found}" if hasattr(
            mutator, "list_faults"
        ) else str(found)
    except MutatorError as error:
        return error.exit_code, str(error)


@pytest.mark.slow
@pytest.mark.parametrize("trick", TRICKS)
def test_no_command_of_a_hostile_library_reaches_out(world: World, trick: str) -> None:
    TRICKS[trick](world)
    found = []
    for number, (name, words) in enumerate(QUICK.items()):
        without = "reviews" if name == "approve" and "review" not in trick else None
        found += problems(world, name, lambda w=words, n=number: command(world, w, n), without=without)
    for address in ADDRESSES:
        found += problems(world, address, lambda a=address: asked(world, a))
    found += problems(world, "API", lambda: called(world))
    assert found == []


@pytest.mark.slow
@pytest.mark.parametrize("trick", TRICKS)
def test_no_run_of_a_hostile_library_reaches_out(world: World, trick: str) -> None:
    TRICKS[trick](world)
    found = []
    for name, words in SLOW.items():
        found += problems(
            world, name, lambda w=words: command(world, w, 1 if "run" in w or "OUT" in w else 0)
        )
    found += problems(world, "bundle", lambda: packed(world))
    assert found == []
