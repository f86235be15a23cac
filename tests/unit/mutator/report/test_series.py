"""Series for the page: thinned so that no eye sees it, of a bounded choice of experiments."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mutator._common.files import write_json
from mutator.model import Outcome, Record, Status
from mutator.report import series
from mutator.report.series import BUCKETS, chosen, keep, packed_series, thinned
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

from .test_browse import row

HAZARD = {"outcome": Outcome.HAZARD, "hazards": (("H1", 3.0),)}


def test_thinning_keeps_extremes_ends_and_the_edges_of_gaps() -> None:
    """Of 10,000 points at most two a bucket are left, among them each peak."""
    values = np.sin(np.arange(10_000) / 300)
    values[[1234, 7777]] = 5.0, -5.0
    values[4000:4100] = np.nan
    at = thinned(values)
    assert len(at) <= 2 * BUCKETS + 6
    assert {0, 9_999, 1234, 7777, 3999, 4000, 4099, 4100} <= set(at.tolist())
    assert np.array_equal(at, np.unique(at))


@pytest.mark.parametrize("length", [5, 5_000])
def test_of_a_level_stretch_the_ends_are_left(length: int) -> None:
    """A channel that never changes is two points."""
    assert thinned(np.full(length, 7.0)).tolist() == [0, length - 1]


@pytest.fixture
def made(toycar: Workspace, record: Callable[..., Record]) -> dict[str, Any]:
    """The series of two runs of the toy, of which the faulty one ends early and leaves the other at 2 s."""
    t = np.arange(0.0, 6.0, 0.05)
    golden = {"time": t, "gas": np.ones_like(t), "speed": np.full_like(t, np.inf)}
    faulty = {"time": t[:80], "gas": np.where(t < 2.0, 1.0, 1.5)[:80], "speed": golden["speed"][:80]}
    return packed_series(toycar.manifest("toycar"), golden, faulty, record(t_manifest=2.0))


def test_a_series_says_where_the_runs_differ(made: dict[str, Any]) -> None:
    """Over the time that both have; infinite values are gaps, and no difference where both are infinite."""
    gas, speed = made["channels"]
    assert (gas["name"], gas["compared"], gas["largest"]) == ("gas", True, 0.5)
    assert gas["strip"] == "0" * 40 + "9" * 40
    assert gas["until"] == 3.95
    assert made["end"] == 5.95
    assert (speed["strip"], speed["largest"]) == ("0" * 80, 0.0)
    assert set(speed["golden"][1]) == {None}
    assert made["marks"] == [["trigger", 2.0, "activated"], ["manifest", 2.0, "manifested"]]


def test_each_fault_type_is_chosen_before_any_a_second_time() -> None:
    """Hazards first, most frequent ones first, the first by id; one experiment in so many, none of little."""
    of = [replace(row(f"{i:02}"), fault_type=f"type{i % 3}") for i in range(60)]
    rows = [replace(r, **HAZARD) if i < 9 else r for i, r in enumerate(of)]
    assert chosen(rows) == ["00", "01", "02"]
    assert chosen(rows[:19]) == []
    assert chosen([replace(r, status=Status.CRASHED, outcome=None) for r in rows]) == []


def test_a_kept_series_is_the_same_file_each_time(
    tmp_path: Path, toycar: Workspace, record: Callable[..., Record]
) -> None:
    """It is where the page looks, and a script that a page on a disk may load."""
    write_json(tmp_path / "run.json", {"schema": "run/1"})
    folder, trace = RunFolder.unverified(tmp_path), {"time": np.arange(3.0), "gas": np.ones(3)}
    path = keep(folder, toycar.manifest("toycar"), trace, trace, record())
    before = path.read_bytes()
    assert before.startswith(b'Series.loaded("eeeeeeeeeeeeeeee", "')
    assert keep(folder, toycar.manifest("toycar"), trace, trace, record()).read_bytes() == before
    assert series.kept(tmp_path / "report") == ["e" * 16]
