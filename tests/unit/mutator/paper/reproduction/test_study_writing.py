"""Machines share a study: each adds rows to the tables, and the last one writes the pages."""

import gzip
from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd
import pytest

from mutator.errors import MutatorError, MutatorWarning
from mutator.paper import reproduce
from mutator.paper.reproduction import data_set
from mutator.paper.reproduction.study_campaigns import STUDY
from mutator.paper.reproduction.study_clone import RESULTS_PAGE, TABLES_FOLDER, StudyClone
from mutator.paper.reproduction.study_tables import Row, StudyTables, combined, load_tables
from mutator.statistics.statistics_sheet import Sheet
from mutator.workspace import Workspace

from .made_up_study import CLONE, COMMIT, made_up_rows, made_up_tables

NAMES = [campaign.name for campaign in STUDY]
Write = Callable[..., list[str]]


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    """Write what a machine gives that has driven some campaigns in a folder of its own, at a commit, and
    computes the tables, perhaps at another one.
    """

    def write(folder: Path, driven: Sequence[str], commit: str, tables_commit: str = "") -> list[str]:
        def write_data_set(_folder: Path, _root: Path, *others: object) -> list[Row]:
            tables = others[-1]
            assert isinstance(tables, StudyTables)
            of_others = [row for row in tables.rows("data_set") if row["file"] not in driven]
            return [*of_others, *({"file": name, "bytes": "1", "sha256": "d"} for name in driven)]

        monkeypatch.setattr(reproduce, "is_driven", lambda _, campaign: campaign.name in driven)
        monkeypatch.setattr(reproduce, "finished_folder", lambda *_: None)
        monkeypatch.setattr(reproduce, "rows_of_campaign", lambda c, _, __, *of: made_up_rows(c, *of))
        monkeypatch.setattr(reproduce, "write_data_set", write_data_set)
        page = tmp_path / "docs" / "explanation" / "differences-from-the-paper.md"
        page.parent.mkdir(parents=True, exist_ok=True)
        page.write_text("Text.\n")
        clone = StudyClone(root=tmp_path, commit=tables_commit or commit)
        return reproduce.write_study(Workspace.find(CLONE), STUDY, folder, clone, commit, tmp_path)

    return write


def test_the_last_machine_writes_the_pages(write: Write, tmp_path: Path) -> None:
    """The tables are those of one machine that drives everything."""
    assert write(tmp_path / "a", NAMES[:1], COMMIT) == NAMES[1:]
    assert not (tmp_path / RESULTS_PAGE).exists()
    assert write(tmp_path / "b", NAMES[1:3], COMMIT) == NAMES[3:]
    assert write(tmp_path / "c", NAMES[3:], COMMIT) == []
    tables = load_tables(tmp_path / TABLES_FOLDER)
    assert tables.without_campaigns([]).different_tables(made_up_tables().without_campaigns([])) == []
    assert sorted(row["file"] for row in tables.rows("data_set")) == sorted(NAMES)
    assert (tmp_path / RESULTS_PAGE).read_text().startswith("# Results")


def test_rows_of_another_commit_are_not_kept(write: Write, tmp_path: Path) -> None:
    write(tmp_path / "a", NAMES[:1], COMMIT)
    with pytest.warns(MutatorWarning, match=f"earlier rows of {NAMES[0]} are left out"):
        assert write(tmp_path / "b", NAMES[1:], "cd" * 20) == NAMES[:1]
    assert {row["commit"] for row in load_tables(tmp_path / TABLES_FOLDER).rows("runs")} == {"cd" * 20}


@pytest.mark.parametrize("is_equal", [True, False])
def test_rows_are_kept_where_the_same_files_decide_them(
    write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_equal: bool
) -> None:
    """Then the tables stay of the commit at which the first of them were computed."""
    monkeypatch.setattr(StudyClone, "decides_figures_as", lambda *_: is_equal)
    write(tmp_path / "a", NAMES[:1], COMMIT)
    if is_equal:
        assert write(tmp_path / "b", NAMES[1:], COMMIT, "cd" * 20) == []
        assert load_tables(tmp_path / TABLES_FOLDER).digest() == digest_of_one_machine(write, tmp_path)
    else:
        with pytest.warns(MutatorWarning, match="are left out"):
            assert write(tmp_path / "b", NAMES[1:], COMMIT, "cd" * 20) == NAMES[:1]


def digest_of_one_machine(write: Write, tmp_path: Path) -> str:
    write(tmp_path / "c", NAMES, COMMIT)
    return load_tables(tmp_path / TABLES_FOLDER).digest()


@pytest.mark.parametrize("content", [None, "campaign\n"])
def test_tables_that_cannot_be_read_are_replaced(write: Write, tmp_path: Path, content: str | None) -> None:
    """Those of an interrupted writing have no `runs.csv`."""
    write(tmp_path / "a", NAMES[:1], COMMIT)
    runs = tmp_path / TABLES_FOLDER / "runs.csv"
    runs.unlink()
    if content:
        runs.write_text(content)
    assert write(tmp_path / "b", NAMES[1:], COMMIT) == NAMES[:1]
    assert not load_tables(tmp_path / TABLES_FOLDER).rows("alerts", campaign=NAMES[0])


def test_a_gap_in_the_rows_of_another_machine_is_refused(write: Write, tmp_path: Path) -> None:
    """Nothing is written then."""
    write(tmp_path / "a", NAMES[:1], COMMIT)
    observations = tmp_path / TABLES_FOLDER / "observations.csv"
    observations.write_text(observations.read_text().splitlines()[0] + "\n")
    before = {path.name: path.read_bytes() for path in observations.parent.iterdir()}
    with pytest.raises(MutatorError, match="rows of other machines"):
        write(tmp_path / "b", NAMES[1:], COMMIT)
    assert {path.name: path.read_bytes() for path in observations.parent.iterdir()} == before


def test_the_data_set_keeps_files_that_were_brought_from_another_machine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(data_set, "_experiments", lambda name, _: pd.DataFrame({"campaign": [name]}))
    monkeypatch.setattr(
        data_set, "_dictionary", lambda _: Sheet(name="d", title="", note="", heads=("column",), lines=())
    )
    first, second = tmp_path / "first", tmp_path / "second"
    rows = data_set.write_data_set(first, CLONE, STUDY, {NAMES[0]: None}, made_up_tables())  # type: ignore[dict-item]
    [name, *_] = names = sorted(data_set.files_of_campaigns(STUDY[:1]))
    tables = combined([{"data_set": rows, "runs": made_up_tables().rows("runs")}])
    second.mkdir()
    (second / name).write_bytes((first / name).read_bytes())
    (second / "stale" / "folder").mkdir(parents=True)
    others = dict.fromkeys(NAMES[1:])
    again = data_set.write_data_set(second, CLONE, STUDY, others, tables)  # type: ignore[arg-type]
    assert (second / name).read_bytes() == (first / name).read_bytes() and not (second / "stale").exists()
    assert {row["file"] for row in again} >= set(names)
    assert all(name in (second / "SHA256SUMS").read_text() for name in names)
    missing = [each for each in names if each != name]
    assert data_set.differing_files(second, again) == missing
    assert data_set.differing_files(second, again, may_be_missing=names) == []


def test_the_same_content_may_be_compressed_otherwise(tmp_path: Path) -> None:
    """A file that unpacks to more than the genuine one, and a damaged one, have another content."""
    text, frame = b"campaign\n" * 100, pd.DataFrame({"campaign": ["coded", "described"]})
    genuine, other = tmp_path / "genuine.csv.gz", tmp_path / "other.csv.gz"
    genuine.write_bytes(gzip.compress(text, 9, mtime=0))
    for data, is_same in (
        (gzip.compress(text, 1, mtime=0), True),
        (gzip.compress(text + b"coded\n"), False),
        (gzip.compress(text.replace(b"a", b"b")), False),
        (genuine.read_bytes()[:-4], False),
        (b"no gzip", False),
    ):
        other.write_bytes(data)
        assert data_set.has_same_content(other, genuine) is is_same
    frame.to_parquet(tmp_path / "genuine.parquet", compression="zstd")
    for cells, is_same in ((frame, True), (frame[::-1], False)):
        cells.to_parquet(tmp_path / "other.parquet", compression="snappy")
        assert data_set.has_same_content(tmp_path / "other.parquet", tmp_path / "genuine.parquet") is is_same
