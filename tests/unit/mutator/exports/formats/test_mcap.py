"""Experiments exported as MCAP files and read back with the mcap library."""

import json
import math
import shutil
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from mcap.reader import make_reader

from mutator.errors import MutatorError, MutatorWarning
from mutator.exports import ExportSelection, ExportTable, Format
from mutator.exports.run_export import export
from mutator.model import Experiment, ObservedActivation, Outcome
from mutator.store.run_deletion import list_deletable_files
from mutator.store.run_folder import RunFolder
from mutator.store.series_format import ExtraPoints, Series, encode_series
from mutator.store.time_series_folder import TimeSeriesFolder, run_facts_for_series, write_rerun_series
from mutator.workspace import Workspace

CHANNELS = [
    {
        "name": "gas",
        "unit": "-",
        "role": "actuator",
        "component": "pedal",
        "about": "gas pedal",
        "compared": True,
    },
    {"name": "gap", "unit": "m", "role": "truth", "component": "", "about": "", "compared": False},
]
GOLDEN = Series(
    t=np.array([0.0, 0.5, 1.0]),
    channel_values=list(np.array([[0.0, 0.25, 0.5], [40.0, 30.0, math.inf]], dtype="<f4")),
    sample_every=[1, 1],
    facts={"start": 0.0, "end": 1.0, "channels": CHANNELS},
)
FAULTY = Series(  # the run ended after 0.5 s; gas was 1 for one step in between
    t=np.array([0.0, 0.5]),
    channel_values=list(np.array([[0.0, 0.75], [40.0, math.nan]], dtype="<f4")),
    sample_every=[1, 1],
    facts={"end": 1.0},
    extra_points=ExtraPoints(
        channel_numbers=np.array([0]),
        t=np.array([0.35]),
        golden_values=np.array([0.125], dtype="<f4"),
        faulty_values=np.array([1.0], dtype="<f4"),
    ),
)


def became(e: Experiment) -> dict[str, Any]:
    if e.fault.fault_type != "lane":
        return {}
    return {
        "outcome": Outcome.HAZARD,
        "activation": ObservedActivation(first=0.25, last=0.5, count=6),
        "t_manifest": 0.35,
        "alerts": (("brake_hard", 0.4),),
        "hazards": (("H3", 0.45), ("H1", 0.5)),
        "t_end": 0.45,
        "left": (("gas", 0.35, 0.875),),
        "max_dev": (("gas", 0.875),),
    }


@pytest.fixture(scope="module")
def run(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    write_run: Callable[..., Path],
) -> Path:
    """A run of eight experiments. Only those with hazards have a series."""
    folder = tmp_path_factory.mktemp("mcap")
    run = write_run(copy_toycar(folder), folder / "run", became, limit=8)
    golden = encode_series(GOLDEN)
    for record in RunFolder.open(run).records().values():
        if record.hazards:
            faulty = replace(FAULTY, facts=FAULTY.facts | run_facts_for_series(record))
            write_rerun_series(
                TimeSeriesFolder(run).rerun_series_path(record.experiment_id),
                golden,
                encode_series(faulty, GOLDEN),
            )
    return run


def hazardous(run: Path) -> list[str]:
    return [r.experiment_id for r in RunFolder.open(run).records().values() if r.hazards]


def test_golden_run_faulty_run_and_events_are_read_back(run: Path, tmp_path: Path) -> None:
    only = 'outcome == "hazard" and fault_type == "lane"'
    out = export(run, Format.MCAP, tmp_path / "out", selection=ExportSelection(only=only))
    assert sorted(path.stem for path in out.iterdir()) == sorted(hazardous(run))
    name = hazardous(run)[0]
    messages: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    with (out / f"{name}.mcap").open("rb") as file:
        reader = make_reader(file)
        for schema, channel, message in reader.iter_messages():
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            told = json.loads(message.data)
            assert set(json.loads(schema.data)["required"]) == set(told)
            messages[channel.topic].append((message.log_time, told))
            if channel.topic == "/faulty/gas":
                assert schema.name == "gas [-]"
                about = {"unit": "-", "role": "actuator", "component": "pedal", "about": "gas pedal"}
                assert channel.metadata == about
            if channel.topic == "/golden/gap":
                assert channel.metadata["unit"] == "m"
        facts = {record.name: record.metadata for record in reader.iter_metadata()}["experiment"]
    assert (facts["id"], facts["outcome"], facts["target"]) == (name, "hazard", "toycar")
    values = {topic: [(t, m.get("value")) for t, m in told] for topic, told in messages.items()}
    ms = 1_000_000
    assert values["/golden/gas"] == [(0, 0.0), (350 * ms, 0.125), (500 * ms, 0.25), (1000 * ms, 0.5)]
    assert values["/faulty/gas"] == [(0, 0.0), (350 * ms, 1.0), (500 * ms, 0.75)]
    assert values["/golden/gap"] == [(0, 40.0), (500 * ms, 30.0), (1000 * ms, None)]
    assert values["/faulty/gap"] == [(0, 40.0), (500 * ms, None)]
    assert [(t / ms, m["kind"], m["name"]) for t, m in messages["/events"]] == [
        (250, "activation", ""),
        (350, "manifested", ""),
        (400, "alert", "brake_hard"),
        (450, "hazard", "H3"),
        (450, "end_of_drive", ""),
        (500, "last_active", ""),
        (500, "hazard", "H1"),
    ]


def test_negative_times_are_shifted(run: Path, tmp_path: Path) -> None:
    """Log times cannot be negative."""
    copy, name = tmp_path / "run", hazardous(run)[0]
    shutil.copytree(run, copy)
    early = replace(GOLDEN, t=GOLDEN.t - 0.5)
    about = FAULTY.facts | run_facts_for_series(RunFolder.open(copy).records()[name])
    faulty = replace(FAULTY, t=FAULTY.t - 0.5, facts=about)
    write_rerun_series(
        TimeSeriesFolder(copy).rerun_series_path(name), encode_series(early), encode_series(faulty, early)
    )
    only = f'experiment_id == "{name}"'
    [file] = export(copy, Format.MCAP, tmp_path / "out", selection=ExportSelection(only=only)).iterdir()
    times = defaultdict(list)
    with file.open("rb") as opened:
        reader = make_reader(opened)
        for _, channel, message in reader.iter_messages():
            times[channel.topic].append(message.log_time)
        facts = {record.name: record.metadata for record in reader.iter_metadata()}
    ms = 1_000_000
    assert times["/golden/gap"] == [0, 500 * ms, 1000 * ms]
    assert times["/events"][0] == 750 * ms  # the activation at 0.25 s, shifted by 0.5 s
    assert facts["times"] == {"first_s": "-0.5"}


def test_a_damaged_trace_is_refused(
    run: Path, tmp_path: Path, copy_toycar: Callable[[Path], Workspace]
) -> None:
    copy, name = tmp_path / "run", hazardous(run)[0]
    shutil.copytree(run, copy)
    faulty = copy / "traces" / name / "faulty"
    for folder in (faulty, copy / "traces" / name / "golden"):
        folder.mkdir(parents=True)
    (faulty / "log.npz").write_bytes(b"rubbish")
    parts = ExportSelection(only=f'experiment_id == "{name}"')
    with pytest.raises(
        MutatorError, match=rf"log.npz: the kept trace of {name}.*mutator rerun {name} --trace"
    ):
        export(copy, Format.MCAP, tmp_path / "out", workspace=copy_toycar(tmp_path), selection=parts)
    assert list((tmp_path / "out").iterdir()) == []


def test_the_same_run_gives_the_same_bytes(run: Path, tmp_path: Path) -> None:
    parts = ExportSelection(only=f'experiment_id == "{hazardous(run)[0]}"')
    first, again = (next(export(run, Format.MCAP, tmp_path / x, selection=parts).iterdir()) for x in "ab")
    assert first.read_bytes() == again.read_bytes()


def test_experiments_without_a_series_are_reported(run: Path, tmp_path: Path) -> None:
    left = 8 - len(hazardous(run))
    with pytest.warns(
        MutatorWarning, match=f"lack of series: {left} of 8 experiments.*mutator rerun .* --trace"
    ):
        out = export(run, Format.MCAP, tmp_path / "out")
    assert len(list(out.iterdir())) == len(hazardous(run))
    with pytest.raises(MutatorError, match=r"none with a series.*mutator rerun"):
        export(run, Format.MCAP, tmp_path / "none", selection=ExportSelection(only='outcome == "masked"'))
    with pytest.raises(MutatorError, match=r"0 experiments.*widen `only`"):
        export(run, Format.MCAP, tmp_path / "none", selection=ExportSelection(only='scenario == "Z"'))
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("format", "parts", "name"),
    [
        (Format.CSV, ExportSelection(only='scenario == "A"'), "only"),
        (Format.MCAP, ExportSelection(table=ExportTable.TIMINGS), "table"),
        (Format.CSV, ExportSelection(failures=["hazard"]), "failures"),
    ],
)
def test_an_option_that_a_format_does_not_use_is_refused(
    run: Path, tmp_path: Path, format: Format, parts: ExportSelection, name: str
) -> None:
    with pytest.raises(MutatorError, match=f"leave `{name}` out"):
        export(run, format, tmp_path / "x", selection=parts)


def test_the_tables_of_propagation_and_timings_are_exported(run: Path, tmp_path: Path) -> None:
    parts = ExportSelection(table=ExportTable.PROPAGATION)
    written = export(run, Format.CSV, tmp_path / "p.csv", selection=parts)
    rows = pd.read_csv(written)
    assert list(rows["experiment_id"]) == sorted(hazardous(run))
    assert rows[["channel", "t_first", "max_dev"]].values.tolist() == [["gas", 0.35, 0.875]] * len(rows)
    assert export(run, Format.PARQUET, None, selection=parts).name == "propagation.parquet"
    kept = (run / "exports" / "propagation.parquet").read_bytes()
    assert kept == (run / "propagation.parquet").read_bytes()
    timings = export(run, Format.CSV, None, selection=ExportSelection(table=ExportTable.TIMINGS))
    assert timings == run / "exports" / "timings.csv"
    kept_timings = pd.read_parquet(run / "timings.parquet")
    pd.testing.assert_frame_equal(pd.read_csv(timings), kept_timings, check_dtype=False)


def test_a_run_folder_with_exports_can_be_cleaned(run: Path) -> None:
    for table in ExportTable:
        export(run, Format.CSV, None, selection=ExportSelection(table=table))
        export(run, Format.PARQUET, None, selection=ExportSelection(table=table))
    written = export(run, Format.MCAP, None)
    assert {*written.iterdir()} <= {*list_deletable_files(run)}
