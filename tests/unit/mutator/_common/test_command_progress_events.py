"""Events that a command sends to the program that started it."""

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from mutator._common import command_progress_events
from mutator.errors import MutatorError
from mutator.serve.job_event_reading import EventReader, FileEvent, MessageEvent, PhaseEvent


@pytest.fixture
def pipe(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    reading, writing = os.pipe()
    os.set_inheritable(writing, True)
    monkeypatch.setenv(command_progress_events.EVENTS_FD_VARIABLE, str(writing))
    monkeypatch.setattr(command_progress_events, "_events_pipe_descriptor", None)
    yield reading
    os.close(writing)
    os.close(reading)


def test_the_reader_understands_every_event(pipe: int) -> None:
    command_progress_events.open_events_pipe()
    command_progress_events.report_phase("golden runs", 1, 4, {"sdc": 2})
    command_progress_events.report_warning("old")
    command_progress_events.report_written_file("plot", Path("plots/a.svg"))
    command_progress_events.report_result("verdict: sdc \udcff")
    command_progress_events.report_error("x" * 9_999)
    data = os.read(pipe, 65_536)
    assert [*EventReader().read(data)] == [
        PhaseEvent(event="phase", phase="golden runs", done=1, total=4, outcomes={"sdc": 2}),
        MessageEvent(event="warning", text="old"),
        FileEvent(event="link", kind="plot", path=str(Path.cwd() / "plots/a.svg")),
        MessageEvent(event="result", text="verdict: sdc ?"),
        MessageEvent(event="error", text="x" * command_progress_events.MOST_EVENT_TEXT_LENGTH),
    ]
    assert all(len(line) < 4_096 and json.loads(line)["event"] for line in data.splitlines())


def test_child_processes_do_not_get_the_pipe(pipe: int) -> None:
    """A mutant could otherwise send events."""
    fd = int(os.environ[command_progress_events.EVENTS_FD_VARIABLE])
    assert os.get_inheritable(fd)
    command_progress_events.open_events_pipe()
    assert command_progress_events.EVENTS_FD_VARIABLE not in os.environ
    assert not os.get_inheritable(fd)


@pytest.mark.parametrize("text", ["", "x", "-1", "99999", "9" * 99])
def test_anything_but_an_open_pipe_is_refused(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv(command_progress_events.EVENTS_FD_VARIABLE, text)
    with pytest.raises(MutatorError, match=f"'{text}'"):
        command_progress_events.open_events_pipe()


def test_a_file_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Others could write to it."""
    with (tmp_path / "events").open("w") as file:
        monkeypatch.setenv(command_progress_events.EVENTS_FD_VARIABLE, str(file.fileno()))
        with pytest.raises(MutatorError, match="open pipe"):
            command_progress_events.open_events_pipe()


def test_a_command_goes_on_when_nobody_reads_its_events(monkeypatch: pytest.MonkeyPatch) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    monkeypatch.setattr(command_progress_events, "_events_pipe_descriptor", writing)
    command_progress_events.report_result("done")
    command_progress_events.report_result("again")
    assert command_progress_events._events_pipe_descriptor is None
    os.close(writing)
