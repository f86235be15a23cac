"""A run folder that somebody sends: no command writes, deletes or runs anything outside of it.

tests/torture tries every trick with every command.
"""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.workspace import Workspace

from ..torture.hostile_runs import TRICKS, Sent
from .conftest import Cli

REFUSED = (
    *(f"{name} is a link" for name in ("workers/", "report/", "series/", "work/", "damaged/", "owner.lock")),
    *("results.csv is a link", "plots/{id}.svg is a socket", "work is a file", "all names in other case"),
    *("the ledger names '../../home/mine'", "the ledger announces '/{home}/mine'"),
    *("a file is named b'a\\nb'", "run.json has target '/{home}/evil.yaml'"),
)
VERBS = (
    ("verify", "RUN"),
    ("verify", "RUN", "--repair"),
    ("seal", "RUN"),
    ("report", "RUN"),
    ("export", "RUN", "--format", "csv"),
    ("show", "--run", "RUN"),
    ("rerun", "ID", "--run", "RUN", "--trace"),
    ("compare", "RUN", "RUN"),
    ("plan", "toy", "--out", "RUN"),
    ("run", "toy", "--out", "RUN", "-n", "0"),
    ("merge", "RUN", "--out", "merged"),
    ("clean", "RUN", "--yes"),
)


@pytest.fixture(scope="module")
def finished(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    write_finished: Callable[..., Path],
) -> Path:
    place = tmp_path_factory.mktemp("finished")
    return write_finished(copy_toycar(place), place / "run")


@pytest.fixture
def sent(finished: Path, tmp_path: Path) -> Sent:
    home = tmp_path / "home"
    (home / "tree" / "A").mkdir(parents=True)
    for name in ("mine", "tree/A/log.npz", "tree/4711"):
        (home / name).write_bytes(b"mine")
    run = Path(shutil.copytree(finished, tmp_path / "runs" / "sent"))
    return Sent(run, home, next(iter(mutator.load_run(finished).records)))


def state(folder: Path) -> dict[str, tuple[int, bytes]]:
    paths = (Path(place, name) for place, _, names in os.walk(folder) for name in names)
    return {str(path): (path.lstat().st_mtime_ns, path.read_bytes()) for path in (*paths,)}


@pytest.mark.parametrize("trick", REFUSED)
def test_every_command_refuses_what_leads_out_of_a_run_folder(
    cli: Cli, root: Path, sent: Sent, trick: str
) -> None:
    TRICKS[trick](sent)
    before = state(sent.home)
    for words in VERBS:
        given = {"RUN": sent.run, "ID": sent.experiment}
        answer = cli(*(given.get(word, word) for word in words))
        assert "Traceback" not in answer.err, (words, answer.err)
        assert answer.code in (1, 2) or words[0] == "clean", (words, answer.err)
        assert state(sent.home) == before, words
    with pytest.raises(MutatorError):
        mutator.load_run(sent.run)


@pytest.mark.parametrize("trick", ["programs", "settings", "old patches outside"])
def test_programs_and_settings_in_a_run_folder_do_nothing(
    cli: Cli, root: Path, sent: Sent, trick: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    TRICKS[trick](sent)
    monkeypatch.chdir(sent.run)
    for words in (("seal", "."), ("show", "--run", "."), ("export", ".", "--format", "csv"), ("verify", ".")):
        answer = cli(*words)
        assert answer.code in (0, 1, 2) and "Traceback" not in answer.err, answer.err
    assert not sent.ran.exists()


def test_a_link_to_a_run_folder_can_be_used(cli: Cli, root: Path, sent: Sent) -> None:
    link = sent.home / "latest"
    link.symlink_to(sent.run)
    assert cli("export", link, "--format", "csv").code == 0
    assert cli("show", "--run", link).code == 0
    assert mutator.load_run(link).path == sent.run


def test_links_in_scratch_folders_of_targets_are_no_obstacle(cli: Cli, root: Path, sent: Sent) -> None:
    """A killed command leaves trees of targets, which may have links; deleting them does not follow links."""
    for name in ("work/1-x/out", f"traces/{sent.experiment}/work", "damaged/old"):
        (sent.run / name).mkdir(parents=True)
        (sent.run / name / "link").symlink_to(sent.home / "tree")
        (sent.run / name / "file").symlink_to(sent.home / "mine")
        os.mkfifo(sent.run / name / "pipe")
    before = state(sent.home)
    assert cli("show", "--run", sent.run).code == 0
    assert cli("clean", sent.run, "--yes").code == 0
    assert not sent.run.exists() and state(sent.home) == before
