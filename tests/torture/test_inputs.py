"""Any content of a hand-written file is read, or soon refused with an error that names a file."""

import json
import random
import shutil
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from mutator.workspace import Workspace

from .malformed import malform
from .readers import Told, cli
from .run_folders import done
from .tally import Case, End, Tally
from .worlds import LAST, judged, limited

pytestmark = pytest.mark.slow

HOSTILE = Path(__file__).parents[1] / "toy" / "templates"
TRIES = 600
SOON_S = 1.0  # CPU time in addition to that of a verb with valid files
LONGEST_S = 60  # on a busy machine
VERBS: dict[str, tuple[str, ...]] = {
    "check": ("check",),
    "list": ("list",),
    "plan small": ("plan", "small", "--out", "planned"),
    "plan toy": ("plan", "toy", "--out", "planned"),
    "diff": ("diff", "sensor/distance"),
    "review": ("review", "list"),
}
PATTERNS = {
    "campaign": "campaigns/*.yaml",
    "fault spec": "faults/sensor/*.yaml",
    "context table": "contexts/*.yaml",
    "hazards": "stpa/hazards.yaml",
    "readings": "fault_library/readings.yaml",
    "manifest": "targets/*.yaml",
    "review": "reviews/*.yaml",
    "scenario": "scenarios/*.yaml",
    "fault model": "templates/*.yaml",
    "template": "templates/*.j2",
    "source": "tree/toycar/*.py",
}


class Inputs:
    def __init__(self, root: Path) -> None:
        self.root, self.home = root, root.with_name("genuine")
        shutil.copytree(root, self.home)

    def cases(self, seed: int) -> Sequence[Case]:
        chance = random.Random(seed)
        files = {kind: sorted(self.root.rglob(pattern)) for kind, pattern in PATTERNS.items()}
        kind, verb = chance.choice(sorted(files)), chance.choice(sorted(VERBS))
        path = chance.choice(files[kind])
        how = malform(path, chance)
        names = [one.name for one in self.root.rglob("*.*")]
        names += [path.name, path.parent.name, "targets in the library"]
        try:
            told, cpu_s = self._told(verb)
        finally:
            shutil.rmtree(self.root)
            shutil.copytree(self.home, self.root, symlinks=True)
            shutil.rmtree("planned", ignore_errors=True)
        end, why = judged(told, Told(code=0, said=""), names)
        if cpu_s > SOON_S:
            end, why = End.WRONG, f"took {cpu_s:.1f} s"
        story = f"{how} of {path.name}, then {verb}: {why}\n{told.said[-LAST:]}"
        return [Case(kind=kind, damage=how, reader=verb, end=end, story=story)]

    def _told(self, verb: str) -> tuple[Told, float]:
        began = time.process_time()
        with limited(LONGEST_S):
            code, out, err = cli(*VERBS[verb])
        return Told(code=code, said=out + err), time.process_time() - began


def approve() -> None:
    code, out, err = cli("review", "list", "--json")
    assert code == 0, err
    done("review", "approve", *(group["group"] for group in json.loads(out)), "--by", "nobody")


def test_malformed_files_are_read_or_named_in_an_error(
    toy: Workspace,
    tmp_path: Path,
    seeds: Callable[[int], Sequence[int]],
    print_tally: Callable[[Tally], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    root = toy.library.parent
    monkeypatch.setenv("MUTATOR_ROOT", str(root))
    monkeypatch.chdir(tmp_path)
    shutil.rmtree(toy.library / "faults" / "hostile")
    for template in HOSTILE.iterdir():
        (toy.templates / template.name).unlink()
    (toy.library / "campaigns" / "hostile.yaml").unlink()
    approve()
    inputs = Inputs(root)
    tally = Tally("malformed inputs")
    tally.drive(seeds(TRIES), inputs.cases)
    print_tally(tally)
    assert not tally.wrong
