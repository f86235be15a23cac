"""A second command in the folder of a running campaign does no harm. It gives the right result or is refused
because the folder is in use."""

import random
import shutil
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from mutator.store.packed_patches import PatchFolder
from mutator.workspace import Workspace

from ..differential.command import Command
from ..differential.test_kills import scratch
from .readers import Place, Told, run
from .run_folders import done
from .scenes import SIGNALS
from .tally import Case, End, Tally
from .worlds import LAST, judged

pytestmark = pytest.mark.slow

TRIES = 60
WORDS = ("small", "--limit", "2", "--engine", "fork")
BUSY = ("in use", "another command deleted the folder")


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    workspace: Workspace
    place: Place
    takes_s: float
    right: Told

    @property
    def others(self) -> dict[str, tuple[object, ...]]:
        run, genuine, out = self.place.run, self.place.genuine, self.place.folder / "written"
        experiment = ("--run", run, "--no-plot")
        return {
            "run": ("run", *WORDS, "-n", "0", "--out", run),
            "plan": ("plan", *WORDS[:3], "--out", run),
            "report": ("report", run),
            "verify": ("verify", run),
            "verify --repair": ("verify", run, "--repair"),
            "export": ("export", run, "--format", "csv", "--out", out),
            "show": ("show", self.place.experiment, *experiment),
            "rerun": ("rerun", self.place.experiment, "--run", run, "--trace"),
            "compare": ("compare", genuine, run, "--out", out),
            "clean": ("clean", run, "--yes"),
            "merge": ("merge", genuine, run, "--out", out),
            "review": ("review", "list", "--campaign", "small"),
            "cache": ("cache", "--clear"),
        }

    def cases(self, seed: int) -> Sequence[Case]:
        """Start one command, then the other. Sometimes send one a signal. Then run the command alone."""
        chance = random.Random(seed)
        name = chance.choice(sorted(self.others))
        shutil.rmtree(self.place.folder, ignore_errors=True)
        self.place.folder.mkdir()
        running = self._command("run", *WORDS, "-n", chance.choice("02"), "--out", self.place.run)
        time.sleep(chance.uniform(0.0, self.takes_s))
        other = self._command(*self.others[name])
        both = [running, other]
        if chance.random() < 0.3:
            time.sleep(chance.uniform(0.0, self.takes_s / 2))
            struck = both.pop(chance.randrange(2)).process
            if struck.poll() is None:
                struck.send_signal(chance.choice((*SIGNALS, signal.SIGSTOP)))
                struck.send_signal(signal.SIGCONT)
        for one in (other, running):  # the folder can hold files of both
            one.process.wait()
        said = {one: one.end() for one in (other, running)}
        ends = [self._judge(one, said[one], name if one is other else "run") for one in both]
        if scratch(self.place.run) and len(both) == 2:
            ends.append((End.WRONG, f"left {scratch(self.place.run)}"))
        again = run(self.place)
        if again.code or again.result != self.right.result:
            ends.append((End.WRONG, f"the folder finally has {again.result}\n{again.said[-LAST:]}"))
        end = max((end for end, _ in ends), key=[End.RIGHT, End.REFUSED, End.WRONG].index)
        told = "\n".join(f"{one.process.returncode}: {text[-LAST:]}" for one, text in said.items())
        story = f"{name} beside run: {[why for _, why in ends if why]}\n{told}"
        return [Case(kind=name, damage=f"{len(both)} undisturbed", reader="run", end=end, story=story)]

    def _judge(self, command: Command, said: str, name: str) -> tuple[End, str]:
        """Return how one of the commands ended. Output about an unfinished run is valid, too."""
        code = command.process.returncode
        end, why = judged(Told(code=code, said=said), Told(code=0, said=""), [""])
        if end is End.REFUSED and name == "verify" and code == 1:
            return End.WRONG, "reports an unfinished run as damaged"
        if end is End.REFUSED and name in ("run", "verify --repair") and not any(w in said for w in BUSY):
            known = "not a run folder" in said or "no results" in said
            return (
                (end, why) if known and name != "run" else (End.WRONG, f"{name}: refused for another reason")
            )
        return end, why

    def _command(self, *words: object) -> Command:
        return Command(self.workspace, self.place.run, "-m", "mutator", *map(str, words))


def test_two_commands_at_once_do_no_harm(
    toy: Workspace,
    tmp_path: Path,
    kept_checks: None,
    seeds: Callable[[int], Sequence[int]],
    print_tally: Callable[[Tally], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("MUTATOR_ROOT", str(toy.library.parent))
    monkeypatch.chdir(tmp_path)
    pair = make_pair(toy, tmp_path)
    tally = Tally("two commands at once")
    tally.drive(seeds(TRIES), pair.cases)
    print_tally(tally)
    assert not tally.wrong


def make_pair(toy: Workspace, folder: Path) -> Pair:
    genuine = folder / "genuine"
    done("run", *WORDS, "--out", genuine, "-n", "0")
    began = time.monotonic()
    done("run", *WORDS, "-n", "2", "--out", folder / "timed")
    takes_s = time.monotonic() - began
    experiment = next(iter(PatchFolder(genuine)))
    place = Place(folder=folder / "case", genuine=genuine, campaign=WORDS, experiment=experiment)
    right = run(Place(folder=folder / "right", campaign=WORDS))
    return Pair(workspace=toy, place=place, takes_s=takes_s, right=right)
