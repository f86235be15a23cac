"""Traces in a format of another package."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mutator._common.extension_doors import TRACE_IMPORTER_DOOR
from mutator.errors import BadOutput
from mutator.outcomes.trace_and_record_loading import load_trace
from mutator.targets.channels import Channel

GAP = Channel(name="gap", unit="m", other_trace_name="distance")


def test_a_trace_of_another_package_is_read(tmp_path: Path, door_examples: Path) -> None:
    manifest: Any = SimpleNamespace(trace_file="trace.jsonl", time_channel="t", channels=(GAP,))
    file = tmp_path / "trace.jsonl"
    file.write_text('{"t": 0.0, "distance": 3.5}\n{"t": 0.1, "distance": 3.0}\n')
    trace = load_trace(manifest, tmp_path, [GAP])
    assert {name: list(values) for name, values in trace.items()} == {"t": [0.0, 0.1], "gap": [3.5, 3.0]}
    file.write_text('{"t": 0.0}\n')
    with pytest.raises(BadOutput, match="no channel 'distance'"):
        load_trace(manifest, tmp_path, [GAP])
    file.write_text("3")
    with pytest.raises(BadOutput, match="no step, or one that is no object"):
        load_trace(manifest, tmp_path, [GAP])


def test_a_suffix_is_only_accepted_while_its_package_is_installed(door_examples: Path) -> None:
    assert TRACE_IMPORTER_DOOR.has_name("jsonl")
    assert not TRACE_IMPORTER_DOOR.has_name("jsonl2")
