"""A campaign killed at random moments reaches the same results and leaves nothing behind."""

import os
import random
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from itertools import count
from pathlib import Path

import pytest

from mutator._common.files import is_half_written
from mutator._common.hashing import digest
from mutator.workspace import Workspace

from .command import Command, results

pytestmark = pytest.mark.slow

CLONE = Path(__file__).parents[2]
INT, TERM, KILL = signal.SIGINT, signal.SIGTERM, signal.SIGKILL
Kill = tuple[signal.Signals, bool]  # the flag: kill a single worker instead of the command
EVERY: tuple[Kill, ...] = ((INT, False), (TERM, False), (KILL, False), (KILL, True), (TERM, True))


def contents(tree: Path) -> dict[str, bytes]:
    return {str(p.relative_to(tree)): p.read_bytes() for p in sorted(tree.rglob("*")) if p.is_file()}


def struck(command: Command, kill: Kill, after_s: float) -> bool:
    """Kill the command, or one of its workers, after `after_s` seconds. Return false if the command ended
    earlier."""
    try:
        command.process.wait(after_s)
        return False
    except subprocess.TimeoutExpired:
        number, one_worker = kill
    if not one_worker:  # Ctrl-C at a terminal goes to the whole foreground group
        (os.killpg if number is INT else os.kill)(command.process.pid, number)
        return True
    while not (workers := command.workers()):
        if command.process.poll() is not None:
            return False
        time.sleep(0.05)
    os.kill(workers[0], number)
    return True


def scratch(out: Path) -> list[Path]:
    """Return files that a run folder may contain only while a command works there."""
    return [path for path in out.rglob("*") if path.name == "work" or is_half_written(path.name)]


def results_digest(out: Path) -> str:
    return digest(sorted((name, digest(data)) for name, data in results(out).items()))


def stage(out: Path) -> str:
    if (out / "results.csv").exists():
        return "results"
    if any((out / "records").glob("*.jsonl")):
        return "experiments"
    return "checks" if (out / "work" / "checks").exists() else "start"


class Campaign:
    """A command that first runs without kills, and is then killed at random moments and repeated."""

    def __init__(self, workspace: Workspace, folder: Path, words: Sequence[str], seed: int) -> None:
        self.workspace, self.folder, self.words = workspace, folder, words
        self.tree = workspace.manifest(workspace.target_name()).root
        self.before = contents(self.tree)
        self.random = random.Random(seed)
        self.stages: list[str] = []  # the stage of each kill
        began = time.monotonic()
        self.longest_s = 0.0
        self.results = self.finish(folder / "undisturbed", [])
        self.longest_s = time.monotonic() - began

    def kill_and_resume(self, kills: Sequence[Kill]) -> None:
        left, number = list(kills), count()
        while left:
            assert self.finish(self.folder / f"killed{next(number)}", left) == self.results

    def finish(self, out: Path, kills: list[Kill]) -> str:
        """Repeat the command until it completes, and kill it while `kills` has entries. Return the digest of
        the results."""
        done = False
        while not done:
            command = Command(
                self.workspace, out, *self.words, "--out", str(out), XDG_CACHE_HOME=f"{out}-cache"
            )
            hit = bool(kills) and struck(command, kills[0], self.random.uniform(0.0, self.longest_s))
            if hit:
                self.stages.append(stage(out))
                kills.pop(0)
            printed = command.end()  # with all processes it started
            done = command.process.returncode == 0
            assert done or hit, printed
            assert contents(self.tree) == self.before
            if done or command.process.returncode == 130:  # stopped by a signal, and cleaned up
                assert not scratch(out), printed
        return results_digest(out)


def test_a_campaign_survives_twenty_kills(tmp_path: Path, copy_toycar: Callable[[Path], Workspace]) -> None:
    words = ["-m", "mutator", "run", "small", "-n", "2"]
    campaign = Campaign(copy_toycar(tmp_path), tmp_path, words, seed=5)
    campaign.kill_and_resume(random.Random(5).sample(EVERY * 4, 20))
    assert len(campaign.stages) == 20
    assert len(set(campaign.stages)) > 1  # not all before the first experiment


def test_a_campaign_on_the_shipped_controller_survives_kills(tmp_path: Path) -> None:
    for name in ("fault_library", "templates", "target"):
        shutil.copytree(CLONE / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    words = ["-m", "mutator", "run", "paper_reference", "-n", "2", "--limit", "30"]
    words += ["--only", 'scenario in ("S1", "S2")']
    campaign = Campaign(Workspace.find(root=tmp_path), tmp_path, words, seed=6)
    campaign.kill_and_resume(random.Random(6).sample((*EVERY, (KILL, False)), 6))
    assert len(campaign.stages) == 6
