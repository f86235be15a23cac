"""In any surroundings, a campaign gives the same bytes or is refused with a remedy. After the remedy, the
same command gives these bytes."""

import random
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.workspace import Workspace

from ..differential.command import Command
from .readers import Place, Told, run
from .surroundings import MOUNTED, SURROUNDINGS, Surrounding, may_mount
from .tally import Case, End, Tally
from .worlds import LAST, judged

pytestmark = pytest.mark.slow

TRIES = 20  # of each surrounding
WORDS = ("small", "--limit", "2", "--engine", "fork")
BECOME = "\nimport os, sys\nos.execv(sys.executable, [sys.executable, '-m', 'mutator', *sys.argv[1:]])"
REMEDIES = ("to do: ", "expected: ", "resume: ", "the same command")


@dataclass(slots=True, kw_only=True)
class Elsewhere:
    name: str
    workspace: Workspace
    at: Path
    right: Told = field(init=False)

    def __post_init__(self) -> None:
        self.at.mkdir()
        self.right = run(Place(folder=self.at, campaign=WORDS))
        assert self.right.code == 0, self.right.said

    def cases(self, seed: int) -> Sequence[Case]:
        chance = random.Random(seed)
        shutil.rmtree(self.at)
        self.at.mkdir()
        with SURROUNDINGS[self.name](chance, self.at) as around:
            workers = chance.choice(["0", "2"])
            place = Place(folder=around.run_in, campaign=WORDS)
            told = self._there(around, place, workers)
            end, why = self._judge(told, around)
            if end is End.REFUSED:
                around.ease()
                again = run(place)
                if again.result != self.right.result:
                    end, why = End.WRONG, f"later: {again.said}, {again.result}, not {self.right.result}"
        story = f"{around.how}, -n {workers}: exit code {told.code}, {why}\n{told.said[-LAST:]}"
        return [Case(kind=self.name, damage=f"-n {workers}", reader="run", end=end, story=story)]

    def _there(self, around: Surrounding, place: Place, workers: str) -> Told:
        words = ("run", *WORDS, "-n", workers, "--out", str(place.run))
        command = Command(
            self.workspace, place.run, "-c", around.before + BECOME, *words, **around.environment
        )
        said, code = command.end(), command.process.returncode
        result = None
        if code == 0:
            try:
                found = mutator.load_run(place.run)
                result = [found.seal, (place.run / "results.csv").read_bytes()]
            except (MutatorError, OSError) as err:
                result = str(err)
        return Told(code=code, said=said, result=result)

    def _judge(self, told: Told, around: Surrounding) -> tuple[End, str]:
        facts, table = self.right.result
        end, why = judged(told, Told(code=0, said="", result=[facts[-1], table]), [""])
        if end is End.REFUSED and around.is_heard and not any(words in told.said for words in REMEDIES):
            return End.WRONG, "no remedy is given"
        return end, why


@pytest.mark.parametrize("name", SURROUNDINGS)
def test_a_command_completes_in_any_surroundings(
    name: str,
    toy: Workspace,
    tmp_path: Path,
    kept_checks: None,
    seeds: Callable[[int], Sequence[int]],
    print_tally: Callable[[Tally], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if name in MOUNTED and not may_mount(tmp_path):
        pytest.skip("needs the right to mount a disk")
    monkeypatch.setenv("MUTATOR_ROOT", str(toy.library.parent))
    monkeypatch.chdir(tmp_path)
    elsewhere = Elsewhere(name=name, workspace=toy, at=tmp_path / "case")
    tally = Tally(f"surroundings: {name}")
    tally.drive(seeds(TRIES), elsewhere.cases)
    print_tally(tally)
    assert not tally.wrong
