"""The page and Python read the same numbers from the fixture of the series format."""

import json
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mutator.store.run_folder import RunFolder
from mutator.store.series_format import ExtraPoints, Series, encode_series
from mutator.store.time_series_folder import TimeSeriesFolder, write_rerun_series
from mutator.web import asset_text

TRACE = "0123456789abcdef"
FIXTURE = Path(__file__).parents[1] / "fixtures" / "run"
LOADED = """async ([id, known]) => {
    const words = (values) => [...new Uint32Array(values.buffer)];
    try {
        const series = await SeriesFile.load(id, known);
        const bits = ({ t, golden, faulty }) => ({ t: [...t], golden: words(golden), faulty: words(faulty) });
        return series && { ...series, channels: series.channels.map((one) => ({ ...one, ...bits(one) })) };
    } catch (error) {
        return error.message;
    }
}"""  # values as integers with the same bits


@pytest.fixture
def run(tmp_path: Path) -> Path:
    shutil.copytree(FIXTURE / "small" / "series", tmp_path / "series")
    facts = {"series": {"packed": True, "kept": TimeSeriesFolder(tmp_path).rerun_ids()}}
    (tmp_path / "report").mkdir()
    told = f'<script type="application/json" id="facts">{json.dumps(facts)}</script>'
    page = (
        f"<!doctype html><meta charset='utf-8'>{told}<script>{asset_text('replay/series_file.js')}</script>"
    )
    (tmp_path / "report" / "index.html").write_text(page)
    return tmp_path


def load(
    browser: Any, run: Path, name: str, trace: str = TRACE, largest: Mapping[str, float] | None = None
) -> Any:
    context = browser.new_context()
    page = context.new_page()
    page.goto((run / "report" / "index.html").as_uri())
    found = page.evaluate(LOADED, [name, {"trace": trace, "largest": largest or {}}])
    context.close()
    return found


def as_read(run: Path, name: str) -> list[dict[str, Any]]:
    """Return the channels that Python reads, as bits, including the points between the values."""
    read = TimeSeriesFolder(run).load_series(
        name, RunFolder.open_unverified(FIXTURE / "small").records()[name]
    )
    assert read is not None
    golden, faulty = read
    found = []
    for number, channel in enumerate(golden.facts["channels"]):
        mine = faulty.extra_points.channel_numbers == number
        t = np.concatenate((golden.times_of(number), faulty.extra_points.t[mine]))
        order = np.argsort(t, kind="stable")
        runs = ((golden, faulty.extra_points.golden_values), (faulty, faulty.extra_points.faulty_values))
        one, other = (
            np.concatenate((run.channel_values[number], points[mine]))[order] for run, points in runs
        )
        bits = {"golden": one.view("<u4").tolist(), "faulty": other.view("<u4").tolist()}
        found.append({"name": channel["name"], "t": t[order].tolist(), **bits})
    return found


def test_a_page_and_python_read_the_numbers_of_the_fixture(browser: Any, run: Path) -> None:
    expected = json.loads((FIXTURE / "series.json").read_text())
    for name, known in expected.items():
        told = [{key: one[key] for key in ("name", "t", "golden", "faulty")} for one in known["channels"]]
        assert as_read(run, name) == told
        largest = dict(RunFolder.open_unverified(FIXTURE / "small").records()[name].max_dev)
        found = load(browser, run, name, known["about"]["trace"][:16], largest)
        assert [{key: one[key] for key in told[0]} for one in found["channels"]] == told
        assert (found["active"], found["tEnd"]) == (known["about"]["active"], known["about"]["t_end"])
        assert found["end"] == known["about"]["end"]


def test_the_page_reads_the_points_between_the_values(browser: Any, run: Path) -> None:
    t = np.arange(9) / 20
    rows = [np.arange(7, dtype="<f4"), np.array([1, np.inf, -np.inf, np.nan], dtype="<f4")]
    about = {"start": 0.0, "end": 0.3, "channels": [{"name": "a"}, {"name": "b"}]}
    golden = Series(t=t[:7], channel_values=rows, sample_every=[1, 2], facts=about)
    single = np.array([7.5, np.inf], dtype="<f4")
    points = ExtraPoints(
        channel_numbers=np.array([0, 1]),
        t=np.array([0.11, 0.01]),
        golden_values=single,
        faulty_values=-single,
    )
    longer = [np.arange(9, dtype="<f4") ** 2, np.array([1, 2, 3, 4, 5], dtype="<f4")]
    happened = {
        "trace": TRACE,
        "active": None,
        "manifest": None,
        "alerts": [],
        "hazards": [],
        "t_end": None,
        "end": 0.4,
    }
    faulty = Series(t=t, channel_values=longer, sample_every=[1, 2], facts=happened, extra_points=points)
    name = TimeSeriesFolder(run).rerun_ids()[0]
    write_rerun_series(
        TimeSeriesFolder(run).rerun_series_path(name), encode_series(golden), encode_series(faulty, golden)
    )
    (run / "series" / "index.js").unlink()
    page = run / "report" / "index.html"
    page.write_text(page.read_text().replace('"packed": true', '"packed": false'))
    a, b = load(browser, run, name)["channels"]
    assert a["t"] == [0.0, 0.05, 0.1, 0.11, *t[3:].tolist()]
    assert b["t"] == [0.0, 0.01, 0.1, 0.2, 0.3, 0.4]
    values = {key: np.array(b[key], dtype="<u4").view("<f4").tolist() for key in ("golden", "faulty")}
    assert values["faulty"] == [1, -np.inf, 2, 3, 4, 5]
    assert values["golden"][:4] == [1, np.inf, np.inf, -np.inf] and np.isnan(values["golden"][4:]).all()
    assert np.array(a["faulty"], dtype="<u4").view("<f4").tolist() == [0, 1, 4, -7.5, 9, 16, 25, 36, 49, 64]


def test_the_series_of_another_run_is_not_shown(browser: Any, run: Path) -> None:
    """A series names the trace that it was made of, and the page knows the trace of each record."""
    name = next(iter(json.loads((FIXTURE / "series.json").read_text())))
    assert load(browser, run, name) == (
        f"The series of {name} cannot be read: it belongs to another run than the record"
    )


def test_curves_that_deviate_otherwise_than_the_record_says_are_not_shown(browser: Any, run: Path) -> None:
    """Such as those of the golden run, with everything else as in the record."""
    for name, record in RunFolder.open_unverified(FIXTURE / "small").records().items():
        found = TimeSeriesFolder(run).load_series(name, record)
        if found and any(by for _, by in record.max_dev):
            golden, faulty = found
            write_rerun_series(
                TimeSeriesFolder(run).rerun_series_path(name),
                encode_series(golden),
                encode_series(replace(golden, facts=faulty.facts), golden),
            )
            break
    page = run / "report" / "index.html"
    page.write_text(page.read_text().replace('"kept": [', f'"kept": ["{name}", '))
    said = load(browser, run, name, record.trace_digest[:16], dict(record.max_dev))
    assert said == f"The series of {name} cannot be read: it belongs to another run than the record"


def test_a_damaged_series_gives_a_message(browser: Any, run: Path) -> None:
    name = next(iter(json.loads((FIXTURE / "series.json").read_text())))
    for path in (run / "series").glob(f"{16 * '[0-9a-f]'}.js"):
        data = path.read_bytes()
        place = next(place for place in range(100, len(data)) if data[place] > 0xA0)
        path.write_bytes(data[:place] + bytes([data[place] ^ 2]) + data[place + 1 :])
    assert str(load(browser, run, name)).startswith(f"The series of {name} cannot be read")
    assert load(browser, run, "f" * 16) is None
