"""Readers of messages in a manifest."""

import re
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.targets.manifest_files import load_manifest
from tests.unit.mutator.targets.test_manifest_mistakes import WHOLE

READERS = """\
messages:
  brakes:
    at: {file: cart/bus.py, function: Bus.take, entry: true}
    queue: frames
    topic: message[0]
    topics: {speed: 464, angle: 330}
    where: self.name == "car"
  scanner:
    at: {file: cart/scan.py, function: Node.on_scan, entry: true}
    message: scan
    topics: [scan]
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "tree" / "cart").mkdir(parents=True)
    (tmp_path / "glue").mkdir()
    return tmp_path / "cart.yaml"


def test_a_manifest_declares_queues_and_callbacks(path: Path) -> None:
    path.write_text(WHOLE + READERS)
    brakes, scanner = load_manifest(path).message_readers.values()
    assert (brakes.queue, brakes.message, brakes.topic) == ("frames", None, "message[0]")
    assert brakes.value_by_topic == {"speed": 464, "angle": 330} and brakes.where == "self.name == 'car'"
    assert (scanner.queue, scanner.message, scanner.topic) == (None, "scan", None)
    assert scanner.value_by_topic == {"scan": "scan"} and scanner.location.function == "Node.on_scan"


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("    queue: frames\n", "", r"cart.yaml:\d+: neither `queue` nor `message`"),
        ("    message: scan\n", "    message: scan\n    queue: all\n", "both `queue` and `message`"),
        ("queue: frames", "queue: frames()", "'frames()'; expected a variable"),
        ("topic: message[0]", "topic: frame[0]", "'frame[0]'; expected an expression of `message`"),
        ("topic: message[0]", "topic: message.get(1)", "expected an expression of `message`"),
        ("    topic: message[0]\n", "", "2 topics; expected one topic, or `topic`, which tells them apart"),
        ("topics: [scan]", "topics: []", "0 topics; expected at least one topic"),
        ('self.name == "car"', "self.name()", "expected names, attributes, items"),
        ("function: Bus.take, entry: true", "function: Bus.take, value: frames", "expected a statement"),
    ],
)
def test_a_mistake_in_a_reader_is_refused_at_its_line(path: Path, old: str, new: str, expected: str) -> None:
    assert READERS.count(old) == 1
    path.write_text(WHOLE + READERS.replace(old, new))
    pattern = expected if expected.startswith("cart") else re.escape(expected)
    with pytest.raises(MutatorError, match=pattern):
        load_manifest(path)
