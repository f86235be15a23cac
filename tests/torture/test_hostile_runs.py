"""Nothing in a run folder that somebody sends makes a command write, delete or run anything outside of it."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

import mutator
from mutator._common.files import remove_folder
from mutator.errors import MutatorError
from mutator.workspace import Workspace

from .hostile_runs import TRICKS, Sent
from .readers import cli
from .run_folders import done, hazardous
from .worlds import limited

pytestmark = pytest.mark.slow

LONGEST_S = 60  # of a command, on a busy machine
SMALL = ("small", "--limit", "6", "-n", "0")
IN_PYTEST = 9  # every ninth trick is also tried in pytest, which starts a process

VERBS: dict[str, Callable[[Sent], tuple[object, ...]]] = {
    "show the worst": lambda sent: ("show", "--run", sent.run),
    "show": lambda sent: ("show", sent.experiment, "--run", sent.run, "--no-plot"),
    "show a plot": lambda sent: ("show", sent.experiment, "--run", sent.run),
    "verify": lambda sent: ("verify", sent.run),
    "verify the report": lambda sent: ("verify", sent.run, "--report"),
    "seal": lambda sent: ("seal", sent.run),
    "report": lambda sent: ("report", sent.run),
    "history": lambda sent: ("report", sent.run.parent),
    "compare": lambda sent: ("compare", sent.run.parents[1] / "genuine", sent.run),
    "compare with": lambda sent: (
        *("compare", sent.run, sent.run.parents[1] / "genuine"),
        *("--out", sent.run / "report" / "compare-x"),
    ),
    **{
        f"export {kind}": lambda sent, kind=kind: ("export", sent.run, "--format", kind)  # type: ignore[misc]
        for kind in ("csv", "parquet", "junit", "mutation-elements", "mcap", "sarif", "codequality")
    },
    "rerun": lambda sent: ("rerun", sent.experiment, "--run", sent.run),
    "rerun and keep": lambda sent: ("rerun", sent.experiment, "--run", sent.run, "--trace"),
    "plan": lambda sent: ("plan", "small", "--limit", "6", "--out", sent.run),
    "run": lambda sent: ("run", *SMALL, "--out", sent.run),
    "merge": lambda sent: ("merge", sent.run, "--out", sent.run.parents[1] / "merged"),
    "repair": lambda sent: ("verify", sent.run, "--repair"),
    "run again": lambda sent: ("run", *SMALL, "--out", sent.run),
    "clean": lambda sent: ("clean", sent.run, "--yes"),
}


@pytest.fixture(scope="module")
def genuine(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]
) -> Iterator[Path]:
    """A folder with a run and the library of its target."""
    place = tmp_path_factory.mktemp("genuine")
    library = copy_toycar(place / "lib").library
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MUTATOR_ROOT", str(library.parent))
        patch.chdir(place)
        done("run", *SMALL, "--engine", "fork", "--out", place / "run")
        name = hazardous(place / "run")
        done("rerun", name, "--run", place / "run", "--trace")
        yield place


@pytest.fixture
def sent(genuine: Path, tmp_path: Path) -> Iterator[Sent]:
    home = tmp_path / "home"
    (home / "tree" / "A").mkdir(parents=True)
    for name in ("mine", "mine.js", "mine.patch", "evil.yaml", "scenario.yaml", "tree/A/log.npz", "tree/1"):
        (home / name).write_bytes(b"mine: 1\n")
    shutil.copytree(genuine / "run", tmp_path / "genuine")
    run = Path(shutil.copytree(genuine / "run", tmp_path / "runs" / "sent"))
    yield Sent(run, home, hazardous(run))
    remove_folder(tmp_path)


def around(sent: Sent) -> dict[str, tuple[object, ...]]:
    """Everything around the run folder: kinds, times and content."""
    found: dict[str, tuple[object, ...]] = {}
    for place, folders, files in os.walk(sent.home.parent):
        folders[:] = [name for name in folders if Path(place, name) not in (sent.run, _merged(sent))]
        for name in (*folders, *files):
            path = Path(place, name)
            facts = path.lstat()
            content = path.read_bytes() if name in files and not path.is_symlink() else b""
            times = () if path == sent.run.parent or name in HISTORY else (facts.st_mtime_ns,)
            if name not in HISTORY:
                found[str(path)] = (facts.st_mode, facts.st_size if name in files else 0, content, *times)
    return found


HISTORY = ("HISTORY.md", "history.html")  # what `report` writes next to the runs of a folder


def _merged(sent: Sent) -> Path:
    return sent.run.parents[1] / "merged"


def use_api(sent: Sent) -> None:
    with suppress(MutatorError):
        found = mutator.load_run(sent.run)
        repr(found), found._repr_html_(), found.seal, found.counts(), found.results, found.propagation
        one = found.experiment(sent.experiment)
        repr(one), one.patch, one.stretch, one.is_drawn, one.fault_path
        for golden in found.folder.golden_runs:
            found.golden(golden.scenario, golden.changes)
        one.traces()


@pytest.mark.parametrize("trick", TRICKS)
def test_no_trick_reaches_outside(trick: str, sent: Sent, request: pytest.FixtureRequest) -> None:
    TRICKS[trick](sent)
    before = around(sent)
    for verb, words in VERBS.items():
        with limited(LONGEST_S):
            code, out, err = cli(*words(sent))
        said = f"{verb}: {out[-1500:]}{err[-3000:]}"
        assert code in (0, 1, 2, 3) and "Traceback" not in err and "bug in mutator" not in err, said
        assert around(sent) == before, said
        if verb == "show":
            with limited(LONGEST_S):
                use_api(sent)
            assert around(sent) == before, "the API"


@pytest.mark.parametrize("trick", [*TRICKS][::IN_PYTEST])
def test_no_trick_reaches_outside_from_pytest(trick: str, sent: Sent) -> None:
    TRICKS[trick](sent)
    before = around(sent)
    words = ("-q", "-p", "no:cacheprovider", "--campaign", "small", "--campaign-out", str(sent.run))
    empty = sent.home.parent / "genuine"
    ended = subprocess.run(
        [sys.executable, "-P", "-m", "pytest", *words],
        cwd=empty,
        capture_output=True,
        text=True,
        timeout=LONGEST_S,
        check=False,
    )
    assert "Traceback" not in ended.stdout + ended.stderr and "INTERNALERROR" not in ended.stdout
    assert around(sent) == before
