"""Build the run folders to damage."""

import os
import shutil
import signal
from collections.abc import Callable
from pathlib import Path

from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

from ..differential.command import Command
from .readers import READERS, Place, cli, merge, repair, rows, run, verify
from .worlds import World

SMALL = ("small", "--limit", "6")
SHIPPED = ("paper_reference", "--limit", "4", "--only", 'scenario == "S1"')
REFERENCE = ("--engine", "reference")
UNFINISHED = {one.__name__: one for one in (run, repair, verify, rows)}
FORGERIES = ("change_a_digit", "change_json", "double_a_line", "drop_a_line", "swap_two_lines")
QUICK = ("api", "compare", "show", "verify", "export csv", "export mutation-elements", "run")


def finished(home: Path, at: Path) -> World:
    words = (*SMALL, "--engine", "fork")
    done("run", *words, "-n", "0", "--out", home / "run")
    name = hazardous(home / "run")
    done("rerun", name, "--run", home / "run", "--trace")
    done("export", home / "run", "--format", "junit")
    done("compare", home / "run", home / "run")
    done("report", home / "run")
    return World(home=home, place=_place(home, at, words, name), readers=READERS)


def forged(home: Path, at: Path) -> World:
    """A run of the toy with damaged files and recomputed digests."""
    words = (*SMALL, "--engine", "fork")
    done("run", *words, "-n", "0", "--out", home / "run")
    shutil.rmtree(home / "run" / "report")
    place = _place(home, at, words, hazardous(home / "run"))
    return World(home=home, place=place, readers=READERS, damages=FORGERIES)


def half(home: Path, at: Path) -> World:
    return _killed(home, at, (*SMALL, *REFERENCE), 4)


def shards(home: Path, at: Path) -> World:
    for number in (1, 2):
        out = home / f"shard{number}"
        done("run", *SMALL, *REFERENCE, "-n", "0", "--shard", f"{number}/2", "--out", out)
    place = Place(folder=at, shards=(at / "shard1", at / "shard2"))
    return World(home=home, place=place, readers={"merge": merge})


def shipped(home: Path, at: Path) -> World:
    """A run on the shipped controller that is only read."""
    words = (*SHIPPED, *REFERENCE)
    done("run", *words, "-n", "0", "--out", home / "run")
    place = _place(home, at, words, next(iter(RunFolder.open(home / "run").records())))
    return World(home=home, place=place, readers={name: READERS[name] for name in QUICK})


def shipped_half(home: Path, at: Path) -> World:
    return _killed(home, at, (*SHIPPED, *REFERENCE), 2)


BUILDERS: dict[str, Callable[[Path, Path], World]] = {
    one.__name__: one for one in (finished, forged, half, shards, shipped, shipped_half)
}


def done(*words: object) -> None:
    code, _, said = cli(*words)
    assert code == 0, said


def hazardous(run: Path) -> str:
    return next(name for name, record in RunFolder.open(run).records().items() if record.hazards)


def _killed(home: Path, at: Path, words: tuple[str, ...], records: int) -> World:
    out = home / "run"
    command = Command(_workspace(), out, "-m", "mutator", "run", *words, "-n", "2", "--out", str(out))
    command.wait_for_records(records)
    os.killpg(command.process.pid, signal.SIGKILL)
    command.end()
    done("export", out, "--format", "csv")
    name = next(iter(RunFolder.open(out).records()))
    return World(home=home, place=_place(home, at, words, name), readers=UNFINISHED)


def _place(home: Path, at: Path, words: tuple[str, ...], experiment: str) -> Place:
    genuine = Path(shutil.copytree(home / "run", at.parent / "genuine"))
    return Place(folder=at, genuine=genuine, campaign=words, experiment=experiment)


def _workspace() -> Workspace:
    return Workspace.find(root=Path(os.environ["MUTATOR_ROOT"]))
