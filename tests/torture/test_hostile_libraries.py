"""Whatever a stranger's library contains, nothing outside it is read, written, deleted or run."""

import asyncio
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.execution.cluster.bundle import Bundle, unpack_bundle
from mutator.execution.frozen_plan import open_or_freeze_run
from mutator.execution.session_opening import open_session
from mutator.serve.application import ServedSite, build_application
from mutator.serve.served_runs import ServedRuns
from mutator.store.plan_choices import Choices

from .hostile_libraries import SECRET, TRICKS, World, plant_hooks
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
    "approve": ("review", "approve", "--only", 'match(spec, "*lane*")', "--by", "Jane Doe", "--yes"),
    "pictures": ("review", "show", "0", "--pictures", "OUT"),
    "stpa": ("stpa", "--svg", "OUT/analysis.svg"),
    "init": ("init", "OUT", "--target", "tree"),
}
SLOW: dict[str, tuple[object, ...]] = {
    "check": ("check",),
    "check --drive": ("check", "--drive", "--scenario", "A"),
    "try": ("try", "sensor/lane", "--scenario", "A", "--trigger", "near", "--out", "OUT/try"),
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
    "rerun": ("rerun", "0", "--run", "OUT"),
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

    site = ServedSite(workspace=world.workspace, runs=ServedRuns((world.out,)))
    try:
        asyncio.run(build_application(site)(scope, receive, send))
    finally:
        site.jobs.close()
    return 0, b"".join(said).decode("utf-8", "replace")


def packed(world: World) -> tuple[int, str]:
    """Pack a bundle for a cluster's workers, and write it as a worker does."""
    run = world.out / "session"
    choices = Choices(limit=2)
    open_run = partial(open_or_freeze_run, world.workspace, "toy", run, choices, reviewed=False)
    try:
        with open_session(world.workspace, open_run, run, workers=1, engine="reference") as session:
            session.prepare()
            data = Bundle.pack_for_run(world.workspace, session.folder, "reference").data
        (world.out / "place").mkdir()
        unpack_bundle(data, world.out / "place")
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


@pytest.mark.parametrize("trick", [*TRICKS][::8])
def test_a_plan_of_a_hostile_library_reaches_nothing_outside(world: World, trick: str) -> None:
    TRICKS[trick](world)
    for name in ("list", "plan", "diff"):
        assert problems(world, name, lambda n=name: command(world, QUICK[n], 0)) == []


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


@pytest.mark.parametrize("name", ["runs", "runs/try", "runs/try/ID", "runs/try/ID/golden"])
def test_a_try_does_not_follow_links_of_the_current_folder(world: World, name: str) -> None:
    words = ("try", "sensor/lane", "--scenario", "A", "--trigger", "near")
    world.link(name.replace("ID", "0" * 16), world.mine / "folder")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("mutator.model.Experiment.id", "0" * 16)
        assert problems(world, "try", lambda: command(world, words, 0)) == []


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


HOOKED: tuple[tuple[str, ...], ...] = (
    ("mutator", "list"),
    ("mutator", "check"),
    ("mutator", "review", "list"),
    ("mutator", "review", "approve", "--only", 'match(spec, "*lane*")', "--by", "Jane Doe", "--yes"),
    ("mutator", "try", "sensor/lane", "--scenario", "A", "--trigger", "near", "--out", "TRY"),
    ("mutator", "run", "small", "--out", "RUN", "-n", "1"),
    ("mutator", "run", "small", "--out", "CLUSTER", "--cluster", "local:1"),
    ("mutator", "report", "RUN"),
    ("mutator", "verify", "RUN", "--rerun", "1"),
    ("mutator", "show", "0", "--run", "RUN"),
    ("mutator", "export", "RUN", "--format", "csv"),
    ("mutator", "doctor"),
)


@pytest.mark.slow
def test_no_module_setting_or_repository_of_a_library_is_run(world: World, tmp_path: Path) -> None:
    """The current folder is the library's. pytest starts elsewhere: in a folder with a conftest.py, it runs
    that itself."""
    mark = plant_hooks(world)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    home = str(Path(sys.executable).parent)
    environment = os.environ | {"MUTATOR_ROOT": str(world.got), "PATH": f"{home}:{os.environ['PATH']}"}
    by_pytest = ("pytest", "--campaign", "small", "--campaign-out", "PYTEST", "-n", "1")
    before, told = world.state(without="reviews"), []
    for words, place in (*((words, world.got) for words in HOOKED), (by_pytest, elsewhere)):
        names = {name: str(tmp_path / "runs" / name) for name in ("RUN", "CLUSTER", "PYTEST", "TRY")}
        done = subprocess.run(
            [names.get(word, word) for word in words],
            cwd=place, env=environment, capture_output=True, text=True, timeout=300, check=False,
        )  # fmt: skip
        said = done.stdout + done.stderr
        told.append((" ".join(words), done.returncode, "" if done.returncode == 0 else said[-800:]))
        assert not mark.exists(), (words, mark.read_text(), said)
        assert "Traceback" not in said and SECRET not in said, (words, said)
    print(*told, sep="\n")
    assert [one for one in told if one[1] not in (0, 1, 2)] == []
    assert all((tmp_path / "runs" / name / "results.csv").exists() for name in ("RUN", "CLUSTER", "PYTEST"))
    assert world.state(without="reviews") == before
