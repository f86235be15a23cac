"""The series of a run: 20 values per second of each channel, and the important steps in between."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mutator.errors import MutatorError
from mutator.model import Record
from mutator.outcomes.channel_departures import departures_from_golden
from mutator.outcomes.golden_trace_comparison import compare_traces
from mutator.outcomes.series_sampling import SeriesSampler, write_sampled_series
from mutator.outcomes.trace_and_record_loading import Trace
from mutator.store.series_format import Series, decode_series, encode_series
from mutator.store.time_series_folder import TimeSeriesFolder, write_rerun_series
from mutator.targets.channels import Role
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

T = np.arange(500) / 100  # s
GAS, SPEED = 0, 4  # columns of the toy's channels


@pytest.fixture
def manifest(toycar: Workspace) -> TargetManifest:
    return toycar.manifest("toycar")


def rounded(values: Any) -> list[float]:
    words = np.asarray(values, dtype="<f4").view("<u4")
    return ((words + 8) // 16 * 16).view("<f4").tolist()


def trace(time: np.ndarray = T, **channels: np.ndarray) -> Trace:
    names = ("gas", "brake", "wheel_turn", "gap", "speed")
    return {"time": time, **{name: np.zeros(len(time)) for name in names}, **channels}


def stored(sampler: SeriesSampler, faulty: Trace, record: Record) -> tuple[Series, Series]:
    golden = decode_series(sampler.encoded_golden)
    return golden, decode_series(encode_series(sampler.faulty_series(faulty, record), sampler.golden), golden)


def test_a_channel_has_twenty_values_per_second_and_its_last_value(
    manifest: TargetManifest, record: Callable[..., Record]
) -> None:
    one = SeriesSampler(manifest, trace(speed=np.sin(T)))
    golden, faulty = stored(one, trace(speed=np.cos(T)), record())
    assert golden.t.tolist() == [*T[::5], 4.99]
    assert faulty.t.tolist() == golden.t.tolist()
    assert golden.channel_values[SPEED].tolist() == rounded(np.sin(golden.t))
    assert faulty.channel_values[SPEED].tolist() == rounded(np.cos(golden.t))
    assert [channel["name"] for channel in golden.facts["channels"]][:2] == ["gas", "brake"]


def test_internal_channels_have_ten_values_per_second(
    manifest: TargetManifest, record: Callable[..., Record]
) -> None:
    inside = [replace(c, role=Role.INTERNAL) if c.name == "speed" else c for c in manifest.channels]
    one = SeriesSampler(replace(manifest, channels=tuple(inside)), trace(speed=np.sin(T)))
    speed = np.sin(T)
    speed[5] = 3.0
    golden, faulty = stored(one, trace(speed=speed), record())
    assert golden.times_of(SPEED).tolist() == [*T[::10], 4.99]
    assert faulty.channel_values[SPEED].tolist() == rounded(np.sin(golden.times_of(SPEED)))
    assert (faulty.extra_points.t.tolist(), faulty.extra_points.faulty_values.tolist()) == ([0.05], [3.0])


def test_no_peak_between_two_samples_is_lost(manifest: TargetManifest, record: Callable[..., Record]) -> None:
    """The first step that differs, and the steps with the largest differences in the drive and in the whole
    run, are stored as points."""
    gas = np.zeros(500)
    gas[[202, 303, 304, 404]] = 0.1, -7.0, 2.0, 9.0
    one = SeriesSampler(manifest, trace())
    points = stored(one, trace(gas=gas), record(t_end=3.5))[1].extra_points
    assert points.t.tolist() == [2.02, 3.03, 4.04]
    assert points.faulty_values.tolist() == rounded([0.1, -7.0, 9.0])
    assert set(points.channel_numbers.tolist()) == {GAS}
    assert len(stored(one, trace(), record())[1].extra_points.t) == 0


def test_infinite_huge_and_missing_values_survive_rounding(
    manifest: TargetManifest, record: Callable[..., Record]
) -> None:
    speed = np.zeros(500)
    speed[:25:5] = np.inf, -np.inf, np.nan, 3.4e38, 1e300
    faulty = stored(SeriesSampler(manifest, trace()), trace(speed=speed), record())[1]
    first = faulty.channel_values[SPEED][:5]
    assert first[[0, 1, 4]].tolist() == [np.inf, -np.inf, np.inf] and np.isnan(first[2])
    assert first[3] == pytest.approx(3.4e38)


def test_all_channels_are_stored_at_a_hazard(manifest: TargetManifest, record: Callable[..., Record]) -> None:
    speed, gap = np.where(T < 2.0, T, 2 * T), 9.0 - T
    one = SeriesSampler(manifest, trace(speed=T, gap=gap))
    hazards = (("H1", 2.52), ("H3", 3.0), ("H2", 7.0))  # there is already a sample at 3.00 s
    points = stored(one, trace(speed=speed, gap=gap), record(hazards=hazards))[1].extra_points
    there = points.t == 2.52
    assert points.channel_numbers[there].tolist() == [0, 1, 2, 3, SPEED]
    assert points.faulty_values[there] == pytest.approx([0, 0, 0, 6.48, 5.04], rel=1e-6)
    assert points.golden_values[there] == pytest.approx([0, 0, 0, 6.48, 2.52], rel=1e-6)
    assert not np.isin(points.t, [3.0, 7.0]).any()


def test_a_run_that_ends_early_keeps_its_last_step(
    manifest: TargetManifest, record: Callable[..., Record]
) -> None:
    """The last step can be an impact."""
    one = SeriesSampler(manifest, trace(speed=T))
    faulty = stored(one, trace(T[:303], speed=T[:303] ** 2), record())[1]
    assert faulty.t[-1] == 3.0
    assert faulty.facts["end"] == 4.99
    assert (faulty.extra_points.t[-1], faulty.extra_points.faulty_values[-1]) == (3.02, rounded([3.02**2])[0])


def test_a_run_without_a_step_has_no_values(manifest: TargetManifest, record: Callable[..., Record]) -> None:
    faulty = stored(SeriesSampler(manifest, trace()), trace(np.zeros(0)), record())[1]
    assert (len(faulty.t), len(faulty.extra_points.t)) == (0, 0)


def test_a_run_that_lasts_longer_has_more_times(
    manifest: TargetManifest, record: Callable[..., Record]
) -> None:
    time = np.arange(700) / 100
    faulty = stored(SeriesSampler(manifest, trace()), trace(time, speed=time), record())[1]
    assert faulty.t[-1] == 6.99
    assert np.diff(faulty.t).max() < 0.06
    assert faulty.channel_values[SPEED].tolist() == rounded(faulty.t)


def test_both_runs_share_one_time_axis(manifest: TargetManifest, record: Callable[..., Record]) -> None:
    time = np.arange(0.0, 5.0, 0.03)
    faulty = stored(SeriesSampler(manifest, trace()), trace(time, speed=time), record())[1]
    place = np.searchsorted(time, faulty.t + 1e-9, side="right") - 1
    assert faulty.channel_values[SPEED].tolist() == rounded(time[place])


def test_a_channel_with_its_own_times_keeps_its_newest_value(
    manifest: TargetManifest, record: Callable[..., Record]
) -> None:
    own = {"gap": np.array([1.0, 2.0]), "gap@": np.array([1.0, 3.0])}
    golden = stored(SeriesSampler(manifest, {**trace(), **own}), {**trace(), **own}, record())[0]
    gap = dict(zip(golden.times_of(3).tolist(), golden.channel_values[3], strict=True))
    assert np.isnan(gap[0.95])
    assert (gap[1.0], gap[2.95], gap[3.0]) == (1.0, 1.0, 2.0)


def recorded(manifest: TargetManifest, golden: Trace, faulty: Trace, one: Record) -> Record:
    """The record with the deviations of two traces."""
    difference = compare_traces(golden, faulty, manifest.compared_channels, "time")
    left = departures_from_golden(golden, faulty, manifest.channels, "time", one.t_end)
    return replace(one, max_dev=difference.max_dev, left=left)


SLOW = np.arange(0.0, 5.0, 0.03)
PAIRS: dict[str, tuple[Trace, Trace]] = {
    "between two samples": (trace(), trace(gas=np.where(T == 1.02, 0.5, 0.0))),
    "by less than the rounding": (trace(gas=T + 1e6), trace(gas=T + 1e6 + 1e-3)),
    "to no value": (trace(), trace(gas=np.where(T > 3, np.nan, 0.0))),
    "from infinity": (trace(gas=np.full(500, np.inf)), trace(gas=np.where(T > 3, 1.0, np.inf))),
    "beyond single precision": (trace(), trace(gas=1e300 * T)),
    "in an early end": (trace(gas=T), trace(T[:303], gas=T[:303] ** 2)),
    "in a late end": (trace(gas=T), trace(np.arange(700) / 100, gas=np.arange(700) / 50)),
    "at other times": (trace(gas=T), trace(SLOW, gas=2 * SLOW)),
    "at other times that end early": (trace(gas=T), trace(SLOW[:50], gas=2 * SLOW[:50])),
    "of a channel with its own times": (
        {**trace(), "gas": np.zeros(2), "gas@": np.array([1.001, 2.0])},
        {**trace(), "gas": np.array([7.0, 1.0]), "gas@": np.array([1.001, 1.002])},
    ),
}


@pytest.mark.parametrize("name", PAIRS)
def test_the_curves_of_every_run_match_its_record(
    tmp_path: Path, manifest: TargetManifest, record: Callable[..., Record], name: str
) -> None:
    one = recorded(manifest, *PAIRS[name], record())
    write_sampled_series(tmp_path, manifest, *PAIRS[name], one)
    assert TimeSeriesFolder(tmp_path).load_series(one.experiment_id, one) is not None


@pytest.mark.parametrize("forged", ["golden", "larger", "later", "renamed", "nothing"])
def test_curves_that_deviate_otherwise_than_the_record_says_are_refused(
    tmp_path: Path, manifest: TargetManifest, record: Callable[..., Record], forged: str
) -> None:
    """A forger can write the record's digest into any series."""
    pair = trace(gas=T), trace(gas=T**2)
    one = recorded(manifest, *pair, record())
    golden, faulty = stored(SeriesSampler(manifest, pair[0]), pair[1], one)
    channels = golden.facts["channels"]
    curves = {
        "golden": replace(golden, facts=faulty.facts),
        "larger": replace(faulty, channel_values=[row + np.float32(1) for row in faulty.channel_values]),
        "later": replace(faulty, t=np.concatenate((faulty.t[:1], faulty.t[1:] + 1))),
    }
    about = {
        "renamed": {"channels": [channel | {"name": f"x{channel['name']}"} for channel in channels]},
        "nothing": {},
    }
    forgery = curves.get(forged, faulty)
    reference = replace(golden, facts=about.get(forged, golden.facts))
    path = TimeSeriesFolder(tmp_path).rerun_series_path(one.experiment_id)
    write_rerun_series(
        path,
        encode_series(reference),
        encode_series(forgery, golden if forged != "later" else replace(golden, t=golden.t[:0])),
    )
    with pytest.raises(MutatorError):
        TimeSeriesFolder(tmp_path).load_series(one.experiment_id, one)


def test_a_series_is_read_back_from_its_file(
    tmp_path: Path, manifest: TargetManifest, record: Callable[..., Record]
) -> None:
    one = recorded(manifest, trace(), trace(speed=T), record(alerts=(("brake_hard", 2.5),)))
    write_sampled_series(tmp_path, manifest, trace(), trace(speed=T), one)
    path = TimeSeriesFolder(tmp_path).rerun_series_path(one.experiment_id)
    before = path.read_bytes()
    write_sampled_series(tmp_path, manifest, trace(), trace(speed=T), one)
    assert path.read_bytes() == before
    found = TimeSeriesFolder(tmp_path).load_series(one.experiment_id, one)
    assert found is not None
    assert (found[0].channel_values[SPEED] == 0).all()
    assert found[1].facts["alerts"] == [["brake_hard", 2.5]]
