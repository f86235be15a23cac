"""Machines share a study: each adds rows to the tables, and the last one writes the pages."""

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from mutator.paper import reproduce
from mutator.paper.reproduction.data_set import files_of_campaign
from mutator.paper.reproduction.study_campaigns import STUDY
from mutator.paper.reproduction.study_clone import RESULTS_PAGE, TABLES_FOLDER, StudyClone
from mutator.paper.reproduction.study_tables import Row, StudyTables, load_tables
from mutator.workspace import Workspace

from .made_up_study import CLONE, COMMIT, made_up_rows, made_up_tables

NAMES = [campaign.name for campaign in STUDY]
Write = Callable[[Path, Sequence[str], str], list[str]]


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    """Write what a machine gives that has driven some campaigns in a folder of its own, at a commit."""

    def write(folder: Path, driven: Sequence[str], commit: str) -> list[str]:
        def write_data_set(_folder: Path, _root: Path, *others: object) -> list[Row]:
            tables = others[-1]
            assert isinstance(tables, StudyTables)
            of_others = [row for row in tables.rows("data_set") if row["file"] not in driven]
            return [*of_others, *({"file": name, "bytes": "1", "sha256": "d"} for name in driven)]

        monkeypatch.setattr(reproduce, "is_driven", lambda _, campaign: campaign.name in driven)
        monkeypatch.setattr(reproduce, "finished_folders", lambda _, each: {c.name: None for c in each})
        monkeypatch.setattr(reproduce, "rows_of_campaign", lambda c, *_: made_up_rows(c, commit))
        monkeypatch.setattr(reproduce, "write_data_set", write_data_set)
        page = tmp_path / "docs" / "explanation" / "differences-from-the-paper.md"
        page.parent.mkdir(parents=True, exist_ok=True)
        page.write_text("Text.\n")
        clone = StudyClone(root=tmp_path, commit=commit)
        return reproduce.write_study(Workspace.find(CLONE), STUDY, folder, clone, tmp_path)

    return write


def test_the_last_machine_writes_the_pages(write: Write, tmp_path: Path) -> None:
    """The tables are those of one machine that drives everything."""
    assert write(tmp_path / "a", NAMES[:1], COMMIT) == NAMES[1:]
    assert not (tmp_path / RESULTS_PAGE).exists()
    assert write(tmp_path / "b", NAMES[1:3], COMMIT) == NAMES[3:]
    assert write(tmp_path / "c", NAMES[3:], COMMIT) == []
    tables = load_tables(tmp_path / TABLES_FOLDER)
    whole = made_up_tables().of_campaigns(NAMES)
    assert tables.of_campaigns(NAMES).different_tables(whole) == []
    assert sorted(row["file"] for row in tables.rows("data_set")) == sorted(NAMES)
    assert (tmp_path / RESULTS_PAGE).read_text().startswith("# Results")


def test_rows_of_another_commit_are_not_kept(write: Write, tmp_path: Path) -> None:
    write(tmp_path / "a", NAMES[:1], COMMIT)
    assert write(tmp_path / "b", NAMES[1:], "cd" * 20) == NAMES[:1]
    assert {row["commit"] for row in load_tables(tmp_path / TABLES_FOLDER).rows("runs")} == {"cd" * 20}


def test_each_campaign_has_files_of_its_own_in_the_data_set() -> None:
    files = [file for campaign in STUDY for file in files_of_campaign(campaign.name)]
    assert len(set(files)) == 2 * len(STUDY)
