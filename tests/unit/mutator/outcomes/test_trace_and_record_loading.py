"""Traces and records of targets are loaded, or refused as bad output."""

import errno
import json
import os
import zipfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mutator.errors import BadOutput, ResourceShortage
from mutator.outcomes.importers import npz
from mutator.outcomes.trace_and_record_loading import (
    alert_times,
    load_target_record,
    load_trace,
    trace_digest,
)
from mutator.targets.channels import Channel
from mutator.targets.hazard_and_metric_definitions import Hazard

T = np.arange(5) * 0.1
GAS = Channel(name="gas", unit="-")
MANIFEST: Any = SimpleNamespace(
    trace_file="trace.npz",
    record_file="record.json",
    time_channel="t",
    channels=(),
    hazard_rules=(Hazard(name="H1"),),
)


def test_a_trace_is_read(tmp_path: Path) -> None:
    np.savez(tmp_path / "trace.npz", t=T, gas=T * 2, other=T)
    found = load_trace(MANIFEST, tmp_path, [GAS])
    assert set(found) == {"t", "gas"}
    assert (found["gas"] == T * 2).all()
    assert set(load_trace(MANIFEST, tmp_path)) == {"t", "gas", "other"}


def test_an_invalid_trace_is_a_bad_output(tmp_path: Path) -> None:
    path = tmp_path / "trace.npz"
    with pytest.raises(BadOutput):
        load_trace(MANIFEST, tmp_path)
    np.savez(path, t=T, gas=T[:3])
    for channels in (["nosuch"], [GAS]):
        with pytest.raises(BadOutput):
            load_trace(MANIFEST, tmp_path, channels)
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(BadOutput):
        load_trace(MANIFEST, tmp_path)
    np.savez(path, t=T, gas=np.array([{}] * 5, dtype=object))
    with pytest.raises(BadOutput):
        load_trace(MANIFEST, tmp_path, [GAS])
    for values in (np.array(["a"] * 5), np.zeros((5, 2))):
        np.savez(path, t=np.zeros(values.shape), gas=values)
        with pytest.raises(BadOutput):
            load_trace(MANIFEST, tmp_path, [GAS])


def test_an_unusual_file_is_a_bad_output(tmp_path: Path) -> None:
    path = tmp_path / "trace.npz"
    with path.open("wb") as file:
        np.save(file, T)
    with pytest.raises(BadOutput, match="a single array"):
        load_trace(MANIFEST, tmp_path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("t.npy", b"\x93NUMPY\x01\0\x08\0{'a': (\n")
    with pytest.raises(BadOutput, match="not a readable trace"):
        load_trace(MANIFEST, tmp_path)
    path.unlink()
    os.mkfifo(path)
    os.mkfifo(tmp_path / "record.json")
    for load in (load_trace, load_target_record):
        with pytest.raises(BadOutput, match="No such device"):
            load(MANIFEST, tmp_path)


def test_a_record_is_read_with_its_alerts(tmp_path: Path) -> None:
    said = {
        "hazards": {"H1": None, "H2": 3.5},
        "alerts": [{"name": "fcw", "t": 1.0}],
        "alert_events": [{"name": "fcw", "t": 1.0}, {"name": "chime", "t": 1.5}, {"name": "fcw", "t": 2.0}],
    }
    (tmp_path / "record.json").write_text(json.dumps(said))
    record = load_target_record(MANIFEST, tmp_path)
    assert record == said
    assert alert_times(record, ["fcw"]) == [("fcw", 1.0), ("fcw", 2.0)]
    assert alert_times(record | {"alert_events": []}, ["fcw"]) == [("fcw", 1.0)]


@pytest.mark.parametrize(
    "text",
    [
        *("", "{", "[]", "{}", '{"hazards": []}', '{"hazards": {"H1": "soon"}}', '{"hazards": {"H1": NaN}}'),
        *(
            f'{{"hazards": {{}}, "alerts": {alerts}}}'
            for alerts in ('{"x": 1}', '["fcw"]', '[{"name": "fcw"}]')
        ),
    ],
)
def test_an_incomplete_record_is_a_bad_output(tmp_path: Path, text: str) -> None:
    (tmp_path / "record.json").write_text(text)
    with pytest.raises(BadOutput):
        load_target_record(MANIFEST, tmp_path)


def test_a_lack_of_file_handles_is_not_blamed_on_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*given: Any, **more: Any) -> None:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr(npz, "read_bounded", full)
    with pytest.raises(ResourceShortage, match="too many open files"):
        load_trace(MANIFEST, tmp_path)


def test_a_pipe_is_a_bad_output(tmp_path: Path) -> None:
    for name in (MANIFEST.trace_file, MANIFEST.record_file):
        os.mkfifo(tmp_path / name)
    for read in (load_trace, load_target_record, trace_digest):
        with pytest.raises(BadOutput):
            read(MANIFEST, tmp_path)
