"""Lines that count are those that a worker says it wrote."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from mutator.execution.written_files import WrittenFiles
from mutator.execution.xdist_controller import CampaignController
from mutator.store import file_digests
from mutator.store.checksummed_lines import LineWriter

NAME = "records/0001-gw0.jsonl"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    file_digests.save_ledger(tmp_path, file_digests.DigestLedger(files={}))
    return tmp_path


def write(run: Path) -> WrittenFiles:
    writer, written = LineWriter(run / NAME, {"schema": "x/1"}), WrittenFiles()
    writer.append({"a": 1})
    writer.close()
    written.add_report({NAME: writer.sha256})
    return written


def test_lines_of_a_worker_count(run: Path) -> None:
    assert write(run).set_unreported_aside(run) == []
    assert (run / NAME).exists()


def test_lines_that_were_changed_are_set_aside(run: Path) -> None:
    written = write(run)
    lines = (run / NAME).read_bytes()
    (run / NAME).write_bytes(lines + lines)
    assert written.set_unreported_aside(run) == [NAME]
    assert (run / "damaged" / NAME).read_bytes() == lines + lines
    assert file_digests.list_segments(run) == []


def test_lines_of_nobody_are_set_aside_and_lost_lines_are_named(run: Path) -> None:
    written = write(run)
    (run / NAME).rename(run / "records" / "0001-gw7.jsonl")
    assert written.set_unreported_aside(run) == ["records/0001-gw7.jsonl", NAME]


def test_lines_of_a_worker_count_until_it_reports_others(run: Path) -> None:
    """It reports nothing if it dies, or if the command is interrupted."""
    write(run)
    written = WrittenFiles()
    written.note_worker_began("0001-gw0")
    assert written.set_unreported_aside(run) == []
    written.add_report({}, "0001-gw0")
    assert written.set_unreported_aside(run) == [NAME]


class Node:
    """A worker of xdist, as the controller knows it."""

    gateway = SimpleNamespace(id="gw0")

    def sendcommand(self, name: str, **values: object) -> None:
        pass


def test_lines_of_workers_count_if_the_command_is_interrupted(run: Path) -> None:
    """pytest then does not wait for the workers' reports."""
    write(run)
    written = WrittenFiles()
    start = SimpleNamespace(to_bytes=lambda: b"")
    begun = SimpleNamespace(
        listing=None,
        start_for_worker=lambda name: written.note_worker_began(f"0001-{name}") or start,
    )
    node = Node()
    controller = CampaignController({str(run / "small.yaml"): cast("Any", begun)})
    controller._note_collection(node, ["small.yaml::sensor/lane-1"])
    controller._begin_workers(cast("Any", SimpleNamespace(rootpath=run)), [node])
    assert written.set_unreported_aside(run) == []
