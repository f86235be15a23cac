"""Commands that are killed at random moments and repeated until they complete."""

import math
import os
import random
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import mutator
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

from ..differential.command import Command
from .damages import Chance
from .readers import HOW, Place, Told, run
from .run_folders import REFERENCE, SHIPPED, SMALL, done
from .tally import Case
from .worlds import LAST, judged

CLONE = Path(__file__).parents[2]
SHIPPED_RUN = "run of the shipped controller"
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL, signal.SIGHUP)
KILLS = 3  # of one command, at most


@dataclass(slots=True, kw_only=True)
class Scene:
    name: str
    workspace: Workspace
    at: Path  # the folder in which everything happens
    words: tuple[object, ...]
    told: Callable[[], Told]  # reads the command's result
    home: Path | None = None  # the initial content of `at`, if any
    fresh_cache: bool = False  # the checks run, too
    victims: Sequence[str] = ("command", "group")
    takes_s: float = math.inf  # the command's shortest duration

    def cases(self, right: Told, seed: int) -> Sequence[Case]:
        """Kill the command and repeat it several times, then let it complete. Return a case for each kill
        that came in time."""
        chance = random.Random(seed)
        self._begin()
        kills = []
        for _ in range(KILLS):
            began, command = time.monotonic(), self._command()
            kills.append(struck(command, chance, self.victims, self.takes_s))
            command.end()  # with all processes that it started
            if kills == [None]:  # the command completed before any signal
                self.takes_s = min(self.takes_s, time.monotonic() - began)
            if self._is_done(command):
                break
        told = self.told() if self._is_done(command) else self._finish()
        end, why = judged(told, right, [])
        story = f"{self.name}: {kills}: {why}\n{told.said[-LAST:]}"
        return [
            Case(kind=victim, damage=number.name, reader=self.name, end=end, story=story)
            for victim, number in filter(None, kills)
        ]

    def _is_done(self, command: Command) -> bool:
        """A merge killed after its last write is complete: the next one would not overwrite the run."""
        merged = self.name == "merge" and RunFolder.exists(self.at / "run")
        return command.process.returncode == 0 or merged

    def undisturbed(self) -> Told:
        # fills the cache, so that the checks do not add to the duration
        if self.home is None and not self.fresh_cache:
            self._begin()
            self._command().end()
        self._begin()
        began = time.monotonic()
        command = self._command()
        printed, self.takes_s = command.end(), time.monotonic() - began
        assert command.process.returncode in (0, 1), printed
        return self.told()

    def _begin(self) -> None:
        shutil.rmtree(self.at, ignore_errors=True)
        if self.home:
            shutil.copytree(self.home, self.at)
        else:
            self.at.mkdir()

    def _finish(self) -> Told:
        command = self._command()
        printed = command.end()
        if command.process.returncode not in (0, 1):
            return Told(code=command.process.returncode, said=printed)
        return self.told()

    def _command(self) -> Command:
        cache = {"XDG_CACHE_HOME": str(self.at / "cache")} if self.fresh_cache else {}
        return Command(self.workspace, self.at / "run", "-m", "mutator", *map(str, self.words), **cache)


def scenes(workspace: Workspace, homes: Path, at: Path) -> Iterator[Scene]:
    words, shards = (*SMALL, "--engine", "fork"), (at / "shard1", at / "shard2")
    place, scene = Place(folder=at, campaign=words), partial(Scene, workspace=workspace, at=at)
    running, again = ("run", *words, "-n", "2", "--out", place.run), partial(run, place)
    driving = partial(scene, words=running, told=again, victims=tuple(VICTIMS))
    yield driving(name="run")
    yield driving(name="run with checks", fresh_cache=True)
    longer = (*SHIPPED, "--engine", "fork")
    yield driving(
        name=SHIPPED_RUN,
        workspace=Workspace.find(root=CLONE),
        words=("run", *longer, "-n", "2", "--out", place.run),
        told=partial(run, replace(place, campaign=longer)),
    )
    whole = homes / "finished"
    done("run", *words, "--out", whole / "run", "-n", "0")
    yield scene(name="report", words=("report", place.run), told=partial(_written, place), home=whole)
    damaged = _damaged(shutil.copytree(whole, homes / "damaged"))
    yield scene(name="repair", words=("verify", place.run, "--repair"), told=again, home=damaged)
    for shard in shards:
        part = f"{shard.name[-1]}/2"
        done("run", *SMALL, *REFERENCE, "--shard", part, "--out", homes / "shards" / shard.name, "-n", "0")
    merging = ("merge", *shards, "--out", place.run)
    yield scene(name="merge", words=merging, told=partial(_merged, place), home=homes / "shards")


def _damaged(home: Path) -> Path:
    run = home / "run"
    records = next((run / "records").iterdir())
    records.write_bytes(records.read_bytes()[:-1] + b"x\n")
    for path in (next((run / "golden").rglob("*.npz")), next((run / "patches").iterdir())):
        path.write_bytes(path.read_bytes()[:-1])
    return home


def _written(place: Place) -> Told:
    text = (place.run / "report" / "REPORT.md").read_text()
    tables = sorted((place.run / "report" / "tables").glob("[!.]*"))  # a kill leaves half-written files
    return Told(code=0, said="", result=[HOW.sub("", text), *(table.read_text() for table in tables)])


def _merged(place: Place) -> Told:
    found = mutator.load_run(place.run)
    return Told(code=0, said="", result=[found.seal, (place.run / "results.csv").read_text()])


def struck(
    command: Command, chance: Chance, victims: Sequence[str], takes_s: float
) -> tuple[str, signal.Signals] | None:
    """Send a signal to one process of a command, or to all of them, at a random moment of its duration.
    Return the receiver and the signal, or None if no process was left."""
    number, victim = chance.choice(SIGNALS), chance.choice(victims)
    with suppress(subprocess.TimeoutExpired):
        command.process.wait(chance.uniform(0.0, takes_s))
    while command.process.poll() is None:
        with suppress(ProcessLookupError):  # it has just ended normally
            if pids := VICTIMS[victim](command):
                os.kill(chance.choice(pids), number)
                return victim, number
        time.sleep(0.02)
    return None


def _mutants(command: Command) -> list[int]:
    """Return all processes of the command except its workers: mutants, fork servers and others."""
    workers = command.workers()
    return [pid for pid, _ in command.others() if pid not in workers]


VICTIMS: dict[str, Callable[[Command], list[int]]] = {
    "command": lambda command: [command.process.pid],
    "group": lambda command: [-command.process.pid],
    "worker": Command.workers,
    "mutant or fork server": _mutants,
}
