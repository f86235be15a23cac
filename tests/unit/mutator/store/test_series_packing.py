"""Packed series."""

import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mutator.errors import MutatorError
from mutator.model import ObservedActivation, Outcome, Record, Status
from mutator.store.series_format import Series, encode_series
from mutator.store.series_packing import EncodedSeries, SeriesWriter, list_unpacked_worker_files, pack_series
from mutator.store.time_series_folder import TimeSeriesFolder, run_facts_for_series, write_rerun_series

RECORD = Record(
    experiment_id="e" * 16,
    status=Status.OK,
    outcome=Outcome.MASKED,
    detail="",
    tree="t" * 64,
    activation=ObservedActivation(first=2.0, last=3.0, count=5),
    t_manifest=None,
    max_dev=(),
    hazards=(),
    alerts=(),
    trace_digest="f" * 64,
)
IDS = [f"{number:016x}" for number in range(150)]
DRAW = np.random.default_rng(1)
VALUES = DRAW.random((151, 4, 600)).astype("<f4")


def series(number: int) -> Series:
    return Series(
        t=np.arange(600) / 20,
        channel_values=list(VALUES[number]),
        sample_every=[1] * 4,
        facts={"n": number} | run_facts_for_series(RECORD),
    )


GOLDEN = replace(series(150), facts={"channels": []})
MADE = {
    name: EncodedSeries(
        golden_key="A" if number % 2 else "B+alone",
        golden_bytes=encode_series(GOLDEN),
        faulty_bytes=encode_series(series(number), GOLDEN),
    )
    for number, name in enumerate(IDS)
}
WORTH = {name: -number for number, name in enumerate(IDS)}  # the last is the best


def append(run: Path, worker: str, names: list[str]) -> None:
    writer = SeriesWriter(run, worker)
    for name in names:
        writer.append(name, MADE[name])
    writer.close()


def files(run: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (run / "series").iterdir()}


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    run = tmp_path_factory.mktemp("packed")
    append(run, "0001-main", IDS)
    pack_series(run, "p", WORTH, 500)
    return run


def test_each_series_is_found_in_its_chunk(packed: Path) -> None:
    folder = TimeSeriesFolder(packed)
    index = folder.index
    assert index is not None
    assert [*index.entry_number_by_experiment] == IDS[::-1]
    assert len(index.entry_sizes) == 151
    assert len(index.chunk_entry_counts) > 3
    for number, name in enumerate(IDS):
        found = folder.load_series(name, RECORD)
        assert found is not None
        assert found[1].facts == {"n": number} | run_facts_for_series(RECORD)
        assert (np.array(found[1].channel_values) == VALUES[number]).all()
    assert folder.load_series("f" * 16, RECORD) is None
    assert list_unpacked_worker_files(packed) == []


@pytest.mark.parametrize("seed", range(3))
def test_packed_bytes_do_not_depend_on_the_order_of_arrival(tmp_path: Path, packed: Path, seed: int) -> None:
    draw = random.Random(seed)
    order = draw.sample(IDS, len(IDS))
    cuts = sorted(draw.sample(range(1, len(IDS)), 2))
    for session, part in enumerate((order[: cuts[0]], order[: cuts[1]][cuts[0] - 1 :], order[cuts[1] :])):
        append(tmp_path, f"{session}-gw0", part[::2])
        append(tmp_path, f"{session}-gw1", part[1::2])
        pack_series(tmp_path, "p", WORTH, 500)
    assert files(tmp_path) == files(packed)


def test_the_budget_keeps_the_best_series_however_often_they_are_packed(tmp_path: Path) -> None:
    runs = [tmp_path / "once", tmp_path / "twice"]
    append(runs[0], "0001-main", IDS)
    pack_series(runs[0], "p", WORTH, 1)
    for session, part in enumerate((IDS[::2], IDS[1::2])):
        append(runs[1], f"{session}-main", part)
        pack_series(runs[1], "p", WORTH, 1)
    assert sum(map(len, files(runs[0]).values())) < 1_010_000
    index = TimeSeriesFolder(runs[0]).index
    assert index is not None
    assert [*index.entry_number_by_experiment] == IDS[::-1][: len(index.entry_number_by_experiment)]
    assert index.left_out_count == len(IDS) - len(index.entry_number_by_experiment) > 0
    assert files(runs[0]) == files(runs[1])


def test_merged_series_of_shards_equal_those_of_one_run(tmp_path: Path, packed: Path) -> None:
    shards = [tmp_path / name for name in "ab"]
    for shard, part in zip(shards, (IDS[:25], IDS[25:]), strict=True):
        append(shard, "0001-main", part)
    pack_series(shards[0], "p", WORTH, 500)
    (tmp_path / "whole").mkdir()
    pack_series(tmp_path / "whole", "p", WORTH, 500, other_runs=tuple(shards))
    assert files(tmp_path / "whole") == files(packed)


def test_equal_golden_runs_stay_separate(tmp_path: Path) -> None:
    append(tmp_path, "0001-main", IDS[:2])
    for worker, names in (("0002-main", IDS[2:3]), ("0003-main", IDS[3:4])):
        pack_series(tmp_path, "p", WORTH, 500)
        append(tmp_path, worker, names)
    pack_series(tmp_path, "p", WORTH, 500)
    index = TimeSeriesFolder(tmp_path).index
    assert index is not None
    assert [*index.entry_number_by_experiment] == IDS[3::-1]
    assert {*index.golden_by_experiment.values()} == {"A", "B+alone"}


def test_a_truncated_segment_loses_only_its_last_series(tmp_path: Path) -> None:
    append(tmp_path, "0001-main", IDS[:3])
    [segment] = list_unpacked_worker_files(tmp_path)
    segment.write_bytes(segment.read_bytes()[:-100])
    pack_series(tmp_path, "p", WORTH, 500)
    index = TimeSeriesFolder(tmp_path).index
    assert index is not None
    assert [*index.entry_number_by_experiment] == IDS[1::-1]


def test_experiments_of_a_damaged_chunk_can_be_rerun(tmp_path: Path) -> None:
    append(tmp_path, "0001-main", IDS[:3])
    pack_series(tmp_path, "p", WORTH, 500)
    index = TimeSeriesFolder(tmp_path).index
    assert index is not None
    chunk = tmp_path / "series" / f"{index.chunk_entry_counts[-1][0]}.js"
    data = chunk.read_bytes()
    chunk.write_bytes(data[:300] + bytes([data[300] ^ 1]) + data[301:])
    with pytest.raises(MutatorError, match="damaged"):
        TimeSeriesFolder(tmp_path).load_series(IDS[0], RECORD)
    (tmp_path / "series" / "index.js").write_bytes(data)
    with pytest.raises(MutatorError, match="damaged"):
        TimeSeriesFolder(tmp_path).load_series(IDS[0], RECORD)
    write_rerun_series(
        TimeSeriesFolder(tmp_path).rerun_series_path(IDS[0]),
        MADE[IDS[0]].golden_bytes,
        MADE[IDS[0]].faulty_bytes,
    )
    found = TimeSeriesFolder(tmp_path).load_series(IDS[0], RECORD)
    assert found is not None
    assert found[1].facts == {"n": 0, **run_facts_for_series(RECORD)}


def test_the_series_of_another_run_is_refused(packed: Path) -> None:
    """A series names the trace and the events of its run."""
    for other in (replace(RECORD, trace_digest="0" * 64), replace(RECORD, hazards=(("H1", 2.5),))):
        with pytest.raises(MutatorError, match="the series of another run"):
            TimeSeriesFolder(packed).load_series(IDS[0], other)
