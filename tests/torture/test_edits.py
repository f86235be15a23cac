"""After an edit between a killed run and its resume, the command gives the right result or names the change.
Once the change is undone, it completes."""

import os
import random
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from mutator.workspace import Workspace

from ..differential.command import Command
from .damages import DAMAGES, Chance
from .readers import Place, Told, cli, run
from .tally import Case, End, Tally
from .test_inputs import PATTERNS
from .worlds import LAST, judged

pytestmark = pytest.mark.slow

TRIES = 60
WORDS = ("small", "--limit", "2", "--engine", "fork")
FILES = {kind: pattern for kind, pattern in PATTERNS.items() if kind != "review"}  # the toy has no review
CHOICES = (
    *(("--seed", "4"), ("--seed", "3"), ("--limit", "3"), ("--engine", "reference")),
    *(("-n", "1"), ("--only", "value > 1"), ("--shard", "1/2"), ("--reading", "as_coded")),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Edits:
    """A command that is killed, and the changes made before it is repeated. `root` has the library, templates
    and target in a separate git clone."""

    workspace: Workspace
    root: Path
    place: Place
    takes_s: float
    right: Told

    def cases(self, seed: int) -> Sequence[Case]:
        chance = random.Random(seed)
        kind = chance.choice([*FILES] * 2 + ["choice"] * 10 + ["commit", "other version"] * 2)
        shutil.rmtree(self.place.folder, ignore_errors=True)
        self._kill(chance)
        with self._edited(kind, chance) as (what, words):
            code, out, err = cli("run", *WORDS, *words, "--out", self.place.run, "-n", "0")
            result = (self.place.run / "results.csv").read_bytes() if code == 0 else None
        told = Told(code=code, said=out + err, result=result)
        end, why = judged(told, Told(code=0, said="", result=self.right.result[-1]), [""])
        names = {"templates": ("fault model", "template"), "target": ("source", "hazards")}
        said = [
            what.split("/")[-1],
            f"'{Path(what).stem}'",
            kind,
            *(one for one, of in names.items() if kind in of),
        ]
        if end is End.REFUSED and not any(one in told.said for one in said):
            end, why = End.WRONG, f"names none of {said}"
        again = run(self.place)
        if again.code or again.result != self.right.result:
            end, why = End.WRONG, f"{why}; after undoing it: {again.result}\n{again.said[-LAST:]}"
        story = f"{kind}: {what}: {why}\n{told.said[-LAST:]}"
        return [Case(kind=kind, damage=what.split(" of ")[0], reader="run", end=end, story=story)]

    def _kill(self, chance: Chance) -> None:
        run = self.place.run
        words = map(str, ("run", *WORDS, "-n", "2", "--out", run))
        command = Command(self.workspace, run, "-m", "mutator", *words)
        command.wait_for(run / "run.json")
        time.sleep(chance.uniform(0.0, self.takes_s))
        if command.process.poll() is None:
            os.killpg(command.process.pid, signal.SIGKILL)
        command.end()

    @contextmanager
    def _edited(self, kind: str, chance: Chance) -> Iterator[tuple[str, tuple[str, ...]]]:
        if kind == "choice":
            words = chance.choice(CHOICES)
            yield words[0], words
        elif kind == "commit":
            commit(self.root, str(chance.random()))
            yield "commit", ()
        elif kind == "other version":
            head = self.place.run / "run.json"
            data = head.read_bytes()
            head.write_bytes(data.replace(b'"schema": "run/', b'"schema": "run/1'))
            try:
                yield "use a newer version", ()
            finally:
                head.write_bytes(data)
        else:
            path = chance.choice(sorted(self.root.rglob(FILES[kind])))
            data, how = (
                path.read_bytes(),
                chance.choice(["change_a_digit", "drop_a_line", "delete", "comment"]),
            )
            if how == "comment":
                path.write_bytes(data + b"# a remark\n")
            else:
                DAMAGES[how](path, [], chance)
            try:
                yield f"{how} of {path.relative_to(self.root)}", ()
            finally:
                path.write_bytes(data)


def commit(root: Path, text: str) -> None:
    (root / "NOTES").write_text(text)
    who = ("-c", "user.name=a", "-c", "user.email=a@b")
    for words in (("init", "-q"), ("add", "-A"), (*who, "commit", "-q", "-m", text)):
        subprocess.run(["git", "-C", str(root), *words], check=True, capture_output=True)


def make_edits(toy: Workspace, folder: Path) -> Edits:
    root = toy.library.parent
    commit(root, "first")
    began = time.monotonic()
    right = run(Place(folder=folder / "right", campaign=WORDS))
    assert right.code == 0, right.said
    takes_s = time.monotonic() - began
    place = Place(folder=folder / "case", campaign=WORDS)
    return Edits(workspace=toy, root=root, place=place, takes_s=takes_s, right=right)


def test_an_edit_gives_no_wrong_result(
    toy: Workspace,
    tmp_path: Path,
    kept_checks: None,
    seeds: Callable[[int], Sequence[int]],
    print_tally: Callable[[Tally], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("MUTATOR_ROOT", str(toy.library.parent))
    monkeypatch.chdir(tmp_path)
    edits = make_edits(toy, tmp_path)
    tally = Tally("edits between a kill and the next run")
    tally.drive(seeds(TRIES), edits.cases)
    print_tally(tally)
    assert not tally.wrong
