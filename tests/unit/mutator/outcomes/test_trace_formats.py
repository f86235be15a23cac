"""Traces of all formats are read alike, also channels with times of their own."""

from pathlib import Path

import numpy as np
import pytest

from mutator.errors import MutatorError
from mutator.outcomes.hazard_and_metric_judgement import load_judged_run
from mutator.outcomes.trace_and_record_loading import load_target_record, load_trace
from mutator.targets.manifest_files import load_manifest

from .cart import GAP, HEAD, SPEED, T, write_manifest


@pytest.mark.parametrize("kind", ["npz", "csv", "parquet", "mcap"])
def test_every_trace_format_gives_the_same_result(tmp_path: Path, kind: str) -> None:
    import pandas as pd

    places = ("/cart:force", "/cart:state.gap", "/cam:d") if kind == "mcap" else ("force", "gap", "seen")
    force, gap, seen_at = (f"from: '{place}'" for place in places)
    own_times = "" if kind == "mcap" else ", time: t_seen"
    channels = (
        f"  force: {{unit: N, role: actuator, {force}}}\n"
        f"  gap: {{unit: m, {gap}}}\n"
        f"  seen: {{unit: m, {seen_at}{own_times}}}\n"
    )
    head, _, rest = HEAD.partition("trace:")
    _, _, rest = rest.partition("observation:")
    steps = "/cart" if kind == "mcap" else "time"
    trace_and_channels = f"trace: {{file: trace.{kind}, time: {steps}}}\nchannels:\n{channels}"
    (tmp_path / "cart.yaml").write_text(
        f"{head}{trace_and_channels}observation:{rest}"
        'hazards: {HIT: {when: "gap <= 0", terminal: true}, SEEN: {when: "seen < 2"}}\n'
    )
    manifest = load_manifest(tmp_path / "cart.yaml")
    path = tmp_path / manifest.trace_file
    t_seen, seen = np.array([0.5, 3.5]), np.array([5.0, 1.0])
    if kind == "npz":
        np.savez(path, time=T, gap=GAP, force=SPEED, t_seen=t_seen, seen=seen)
    elif kind == "mcap":
        _write_mcap(path, t_seen, seen)
    else:
        frame = pd.DataFrame({"time": T, "gap": GAP, "force": SPEED})
        frame = frame.join(pd.DataFrame({"t_seen": t_seen, "seen": seen}))
        frame.to_csv(path, index=False) if kind == "csv" else frame.to_parquet(path)
    _, found = load_judged_run(manifest, tmp_path)
    assert found.hazards == (("HIT", 3.0), ("SEEN", 4.0))
    trace = load_trace(manifest, tmp_path, manifest.channels)
    assert trace["gap"].tolist() == GAP.tolist()
    assert trace["seen@"].tolist() == t_seen.tolist()
    assert load_target_record(manifest, tmp_path) == {"hazards": {}, "alerts": []}


def test_a_channel_can_be_faster_than_the_steps(tmp_path: Path) -> None:
    """In a CSV trace, rows without a step's time belong to channels with their own times."""
    text = HEAD + 'hazards: {HOT: {when: "heat > 5 and gap > 0"}}\n'
    text = text.replace("trace.npz", "trace.csv")
    text = text.replace("  speed: {unit: m/s, role: truth}\n", "  heat: {unit: degC, time: t_heat}\n")
    (tmp_path / "cart.yaml").write_text(text)
    rows = ["time,gap,force,t_heat,heat", "0,3,1,0,1", ",,,0.5,2", "1,2,1,1,3", ",,,1.5,9", "2,1,1,2,9"]
    (tmp_path / "trace.csv").write_text("\n".join(rows) + "\n")
    manifest = load_manifest(tmp_path / "cart.yaml")
    assert load_judged_run(manifest, tmp_path)[1].hazards == (("HOT", 2.0),)
    assert load_trace(manifest, tmp_path, manifest.channels)["gap"].tolist() == [3.0, 2.0, 1.0]


@pytest.mark.parametrize("times", [[0, 2, 1], [0, 1, np.nan], [0, np.inf, np.inf]])
def test_times_must_increase(tmp_path: Path, times: list[float]) -> None:
    np.savez(tmp_path / "trace.npz", time=times, gap=GAP[:3], speed=GAP[:3], force=GAP[:3])
    manifest = write_manifest(tmp_path, "hazards: {}\n")
    with pytest.raises(MutatorError, match="times of time that decrease or are missing"):
        load_trace(manifest, tmp_path, manifest.channels)


def _write_mcap(path: Path, t_seen: np.ndarray, seen: np.ndarray) -> None:
    import json

    writer_of = pytest.importorskip("mcap.writer")
    with path.open("wb") as file:
        writer = writer_of.Writer(file)
        writer.start()
        schema = writer.register_schema(name="any", encoding="jsonschema", data=b"{}")
        cart, cam = (
            writer.register_channel(topic=t, message_encoding="json", schema_id=schema)
            for t in ("/cart", "/cam")
        )
        rows = [(t, cart, {"force": f, "state": {"gap": g}}) for t, f, g in zip(T, SPEED, GAP, strict=True)]
        rows += [(t, cam, {"d": d}) for t, d in zip(t_seen, seen, strict=True)]
        for t, channel, data in sorted(rows, key=lambda row: row[0]):
            ns = int(t * 1e9)
            writer.add_message(
                channel_id=channel, log_time=ns, publish_time=ns, data=json.dumps(data).encode()
            )
        writer.finish()
