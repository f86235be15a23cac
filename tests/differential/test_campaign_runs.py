"""A campaign gives the same bytes, however it is run, stopped and resumed."""

import os
import random
import re
import shutil
import signal
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.execution.campaign_running import run_campaign
from mutator.execution.session import Session
from mutator.store import file_digests
from mutator.workspace import Workspace

from .command import DERIVED, Bytes, Command, pytest_words, results

CopyToycar = Callable[[Path], Workspace]


@pytest.fixture
def toy(toy: Workspace, kept_checks: None) -> Workspace:
    return toy


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, copy_toycar: CopyToycar) -> Path:
    """The small campaign, run in one process without interruption. Tests must not write to its folder."""
    folder = tmp_path_factory.mktemp("undisturbed")
    summary = run_campaign(copy_toycar(folder), "small", folder / "run")
    assert (summary.exit_code, summary.done, summary.ran) == (0, 12, 12)
    assert {"hazard", "sdc", "not_activated"} <= set(summary.outcomes)
    return folder / "run"


@pytest.fixture(scope="module")
def undisturbed(whole: Path) -> Bytes:
    return results(whole)


@pytest.mark.parametrize("workers", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_the_number_of_workers_changes_no_byte(
    toy: Workspace, tmp_path: Path, undisturbed: Bytes, workers: int
) -> None:
    summary = run_campaign(toy, "small", tmp_path / "run", workers=workers)
    assert summary.exit_code == 0
    assert len(list((tmp_path / "run" / "records").iterdir())) == workers
    assert results(tmp_path / "run") == undisturbed


def test_order_and_interruptions_change_no_byte(
    toy: Workspace, tmp_path: Path, undisturbed: Bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    prepare, draw = Session.prepare, random.Random(3)
    taken: list[int] = []

    def two_chunks(self: Session, packages: Iterable[str], *, checks_beside: bool) -> None:
        prepare(self, packages)
        self.pending = tuple(draw.sample(self.pending, min(2, len(self.pending))))
        taken.extend(item.chunk_index for item in self.pending)

    monkeypatch.setattr(Session, "prepare", two_chunks)
    ends = [(summary := run_campaign(toy, "small", tmp_path / "run")).exit_code]
    while summary.ran:
        summary = run_campaign(toy, "small", tmp_path / "run")
        ends.append(summary.exit_code)
    assert (summary.done, ends) == (12, [3, 3, 0, 0])
    assert sorted(taken) == [0, 1, 2, 3, 4, 5] and any(taken[k] > taken[k + 1] for k in (0, 2, 4))
    assert results(tmp_path / "run") == undisturbed


@pytest.mark.parametrize("closed", [False, True], ids=["by a killed session", "of a finished run"])
def test_lost_records_run_again(
    toy: Workspace, tmp_path: Path, whole: Path, undisturbed: Bytes, closed: bool
) -> None:
    """A kill does not explain a loss from a file that a session has closed, so that file is refused until it
    is repaired."""
    out = shutil.copytree(whole, tmp_path / "run")
    [path] = (out / "records").iterdir()
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:-3]) + lines[-3][:25])
    if closed:
        with pytest.raises(MutatorError, match="10 lines, all with their checksums; expected 13 lines"):
            run_campaign(toy, "small", out)
        assert mutator.verify(out, repair=True, workspace=toy).repaired
    else:
        known = file_digests.load_ledger(out)
        files = {name: one for name, one in known.files.items() if not name.startswith("records/")}
        file_digests.save_ledger(out, replace(known, files=files, finished=False))
    summary = run_campaign(toy, "small", out)
    assert (summary.exit_code, summary.ran) == (0, 3)
    assert results(out) == undisturbed


def test_deleted_tables_are_rebuilt_from_records(
    toy: Workspace, tmp_path: Path, whole: Path, undisturbed: Bytes
) -> None:
    out = shutil.copytree(whole, tmp_path / "run")
    for name in DERIVED:
        (out / name).unlink()
    summary = run_campaign(toy, "small", out)
    assert (summary.exit_code, summary.ran) == (0, 0)
    assert results(out) == undisturbed


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT], ids=lambda s: s.name)
def test_a_killed_campaign_resumes_to_the_same_bytes(
    toy: Workspace, tmp_path: Path, undisturbed: Bytes, number: signal.Signals
) -> None:
    out = tmp_path / "run"
    command = Command(toy, out, *pytest_words(out))
    command.wait_for_records(4)
    if number is signal.SIGINT:  # as a terminal signals the whole foreground group
        os.killpg(command.process.pid, number)
    else:
        command.process.send_signal(number)
    command.end()
    again = Command(toy, out, *pytest_words(out))
    printed = again.end()
    assert again.process.returncode == 0, printed
    assert "12 of 12 experiments done" in printed
    assert "12 now" not in printed
    assert results(out) == undisturbed


@pytest.mark.slow
def test_pytest_resumes_a_killed_run(toy: Workspace, tmp_path: Path, undisturbed: Bytes) -> None:
    out = tmp_path / "run"
    command = Command(toy, out, "-m", "mutator", "run", "small", "--out", str(out), "-n", "2")
    command.wait_for_records(4)
    assert len(command.workers()) == 2
    command.process.kill()
    command.end()
    assert len(list((out / "workers").iterdir())) == 2
    again = Command(toy, out, *pytest_words(out))
    printed = again.end()
    assert again.process.returncode == 0, printed
    assert "12 of 12 experiments done" in printed
    assert "12 now" not in printed
    assert not (out / "workers").exists()
    assert results(out) == undisturbed


@pytest.mark.slow
def test_a_command_killed_during_its_checks_starts_again(
    toycar: Workspace, tmp_path: Path, undisturbed: Bytes
) -> None:
    out = tmp_path / "run"
    command = Command(toycar, out, *pytest_words(out))
    command.wait_for(out / "work" / "checks")
    command.process.kill()
    command.end()
    assert run_campaign(toycar, "small", out).exit_code == 0
    assert results(out) == undisturbed


@pytest.mark.slow
def test_a_run_with_a_killed_worker_exits_with_3_and_can_be_resumed(
    toy: Workspace, tmp_path: Path, undisturbed: Bytes
) -> None:
    out = tmp_path / "run"
    command = Command(toy, out, *pytest_words(out))
    command.wait_for_records(2)
    worker = next((out / "workers").iterdir())
    os.kill(int(worker.name), signal.SIGKILL)
    printed = command.end()
    assert command.process.returncode == 3, printed
    assert "died" in printed
    assert run_campaign(toy, "small", out).exit_code == 0
    assert results(out) == undisturbed


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [["-m", "mutator", "run", "small", "-n", "1", "--out"], None],
    ids=["mutator", "pytest"],
)
def test_a_starting_worker_ends_when_its_command_is_killed(
    toy: Workspace, tmp_path: Path, words: list[str] | None
) -> None:
    out = tmp_path / "run"
    command = Command(toy, out, *(pytest_words(out, workers=1) if words is None else [*words, str(out)]))
    while not (
        started := [pid for pid, line in command.others() if re.match("[^ ]+ -P -u -c .*stdin", line)]
    ):
        assert command.process.poll() is None, command.end()
    os.kill(started[0], signal.SIGSTOP)
    try:
        assert not command.workers()
        command.process.kill()
        deadline = time.monotonic() + 10.0
        while list(command.others()):
            assert time.monotonic() < deadline
    finally:
        with suppress(ProcessLookupError):
            os.kill(started[0], signal.SIGKILL)
        command.end()


@pytest.mark.slow
def test_a_second_command_in_a_folder_in_use_is_refused(
    toy: Workspace, tmp_path: Path, undisturbed: Bytes
) -> None:
    out = tmp_path / "run"
    first = Command(toy, out, *pytest_words(out, workers=0))
    first.wait_for_records(1)
    first.process.send_signal(signal.SIGSTOP)  # to keep it unfinished when the second starts
    try:
        second = Command(toy, out, *pytest_words(out))
        printed = second.process.communicate(timeout=60)[0]
    finally:
        first.process.send_signal(signal.SIGCONT)
    assert second.process.returncode == 2, printed
    assert f"in use by process {first.process.pid}" in printed
    assert "Traceback" not in printed
    first.end()
    assert first.process.returncode == 0
    assert results(out) == undisturbed


@pytest.fixture(scope="module")
def clone() -> Workspace:
    return Workspace.find(root=Path(__file__).parents[2])


@pytest.mark.slow
@pytest.mark.parametrize("reading", ["as_described", "as_coded"])
def test_the_shipped_controller_gives_the_same_bytes(clone: Workspace, tmp_path: Path, reading: str) -> None:
    text = clone.campaign("quickstart").read_text()
    for old, new in (
        ("scenarios: [S1, S2, S3, S4, S5]", "scenarios: [S2]"),
        ("sample: 60", "sample: 16"),
        ("chunk: 4", "chunk: 2"),
        ("reading: as_described", f"reading: {reading}"),
    ):
        assert old in text
        text = text.replace(old, new)
    campaign = tmp_path / "part.yaml"
    campaign.write_text(text)
    one, disturbed = tmp_path / "one", tmp_path / "disturbed"
    assert run_campaign(clone, campaign, one, workers=1).exit_code == 0
    for count, number in ((3, signal.SIGTERM), (9, signal.SIGKILL)):
        command = Command(clone, disturbed, *pytest_words(disturbed, campaign))
        command.wait_for_records(count)
        command.process.send_signal(number)
        command.end()
    summary = run_campaign(clone, campaign, disturbed, workers=2)
    assert summary.exit_code == 0
    assert 0 < summary.ran < 10
    assert results(disturbed) == results(one)
