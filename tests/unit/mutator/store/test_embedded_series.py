"""Series inside a page."""

import base64
from dataclasses import replace
from pathlib import Path

from mutator.model import Record
from mutator.store.embedded_series import EmbeddedSeries, embed_worst
from mutator.store.series_packing import SeriesWriter, pack_series
from mutator.store.time_series_folder import TimeSeriesFolder

from .test_series_packing import IDS, MADE, RECORD


def packed_run(run: Path, names: list[str]) -> TimeSeriesFolder:
    writer = SeriesWriter(run, "0001-main")
    for name in names:
        writer.append(name, MADE[name])
    writer.close()
    pack_series(run, "p", {name: place for place, name in enumerate(names)}, 500)
    return TimeSeriesFolder(run)


def record_of(name: str) -> Record:
    return replace(RECORD, experiment_id=name)


def size(*data: bytes) -> int:
    return sum(len(base64.b64encode(part)) for part in data)


def test_a_golden_run_is_stored_and_counted_once() -> None:
    """Experiments of one golden run share it, so a page holds more of them."""
    embedded = EmbeddedSeries(size(b"golden", b"one", b"two"))
    assert embedded.add({"a": (b"golden", b"one")})
    assert embedded.add({"b": (b"golden", b"two")})
    assert not embedded.add({"c": (b"golden", b"three")})
    assert embedded.size_bytes == embedded.most_bytes
    data = embedded.as_json()
    assert [base64.b64decode(text) for text in data["runs"]] == [b"golden", b"one", b"two"]
    assert data["of"] == {"a": (0, 1), "b": (0, 2)}


def test_both_runs_of_a_pair_are_added_or_neither() -> None:
    """Half a pair could not be compared."""
    embedded = EmbeddedSeries(size(b"golden", b"one"))
    assert not embedded.add({"a": (b"golden", b"one"), "b": (b"golden", b"two")})
    assert embedded.as_json() == {"runs": [], "of": {}}


def test_the_worst_are_embedded_until_one_does_not_fit(tmp_path: Path) -> None:
    names = IDS[:6]
    series = packed_run(tmp_path, names)
    records = [record_of(name) for name in names]
    everything, considered = embed_worst(series, records, 10**9)
    assert (list(everything.as_json()["of"]), considered) == (names, 6)
    some, considered = embed_worst(series, records, everything.size_bytes - 1)
    assert (list(some.as_json()["of"]), considered) == (names[:5], 5)


def test_series_that_are_missing_or_of_another_run_are_left_out(tmp_path: Path) -> None:
    """The page would refuse them, and their bytes could be anything."""
    series = packed_run(tmp_path, IDS[:3])
    records = [None, record_of(IDS[0]), replace(record_of(IDS[1]), trace_digest="e" * 64), record_of(IDS[9])]
    embedded, considered = embed_worst(series, records, 10**9)
    assert (list(embedded.as_json()["of"]), considered) == ([IDS[0]], 4)
