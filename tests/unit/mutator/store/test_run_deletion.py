"""Cleaning deletes exactly the files that a run wrote."""

import os
import re
from pathlib import Path

import pytest

from mutator._common.extension_doors import EXPORT_DOOR
from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.errors import MutatorError
from mutator.exports import ExportTable, find_export
from mutator.store.allowed_contents import ALLOWED_FILE_GLOBS
from mutator.store.run_deletion import delete_run, finish_deletion
from mutator.workspace import Workspace

PAGE = Path(__file__).parents[4] / "docs" / "reference" / "run-folder.md"


@pytest.fixture
def run(toycar: Workspace, tmp_path: Path) -> Path:
    return freeze_plan(build_plan(toycar, "toy"), tmp_path / "run", toycar).path


def contents(folder: Path) -> set[Path]:
    return set(folder.rglob("*"))


def test_everything_that_a_run_wrote_is_deleted(run: Path) -> None:
    """A kill can leave half-written files, and scratch folders have any shape."""
    (run / "report" / "tables").mkdir(parents=True)
    (run / "report" / ".REPORT.md.4711").touch()
    odd = run / "work" / "1-x" / "out"
    odd.mkdir(parents=True)
    (odd / "link").symlink_to(run.parent)
    (odd / "dangling").symlink_to("nowhere")
    os.mkfifo(odd / "pipe")
    delete_run(run)
    assert not run.exists()
    assert run.parent.exists()


@pytest.mark.parametrize("name", EXPORT_DOOR.shipped_names())
def test_the_file_of_each_export_is_no_stranger(run: Path, name: str) -> None:
    """A new format is one module, which cleaning need not know."""
    for table in ExportTable:
        made = run / "exports" / find_export(name).file.format(table=table.value)
        file = made if made.suffix else made / "1.mcap"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    delete_run(run)
    assert not run.exists()


@pytest.mark.parametrize(
    "stranger",
    [
        "thesis.tex",
        "data/night.csv",
        "empty/",
        "records/notes.txt",
        "patches/mine.patch",
        "report/mine.docx",
        "golden/notes",
        "plan/x/y.txt",
        ".notes.1",
        "records/.vimrc.2",
        "plots/talk.pptx",
        "exports/mine.csv",
        "report/tables/summary.ods",
        "report/figures/drawing.afdesign",
        "report/compare-old/notes.txt",
    ],
)
def test_a_run_folder_with_another_file_is_not_deleted(run: Path, stranger: str) -> None:
    path = run / stranger
    path.parent.mkdir(parents=True, exist_ok=True)
    path.mkdir() if stranger.endswith("/") else path.touch()
    before = contents(run)
    first = stranger.partition("/")[0] if "/" in stranger and not (run / stranger).is_file() else ""
    with pytest.raises(MutatorError, match="contains files that no run writes: ") as refused:
        delete_run(run)
    assert (first or stranger.split("/")[0]) in refused.value.got
    assert "move them elsewhere" in str(refused.value)
    assert contents(run) == before


def test_a_foreign_folder_is_not_deleted_despite_its_run_json(tmp_path: Path) -> None:
    for head, names in (
        ('{"schema":"run/3"}', ["a", "b", "c", "d", "e"]),
        ('{"schema":"run/1"}', []),
        ('{"schema":"run/99"}', []),
        ('{"schema":"other/1"}', []),
        ("{}", []),
        ("", []),
    ):
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        folder.mkdir()
        (folder / "run.json").write_text(head)
        for name in names:
            (folder / name).touch()
        with pytest.raises(MutatorError) as refused:
            delete_run(folder)
        assert not names or refused.value.got == "contains files that no run writes: a, b, c and 2 more"
        assert len(contents(folder)) == 1 + len(names)


def test_a_folder_without_run_json_is_not_deleted(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(MutatorError, match="not a run folder"):
        delete_run(tmp_path)
    assert contents(tmp_path) == {tmp_path / "thesis.tex"}


def test_the_docs_list_the_same_names_as_cleaning() -> None:
    [listed] = re.findall(r"^DIR/\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    names = {name for line in listed.splitlines() for name in re.split(r" {2,}", line.strip())[0].split(", ")}
    inside = {name.partition("/")[0] for name in names if not name.startswith(".")}
    assert inside == {pattern.partition("/")[0] for pattern in ALLOWED_FILE_GLOBS}


def test_links_are_not_followed(run: Path, tmp_path: Path) -> None:
    link = tmp_path / "latest"
    link.symlink_to(run)
    with pytest.raises(MutatorError, match=r"a link to .*; name the link.s target"):
        delete_run(link)
    elsewhere = tmp_path / "elsewhere"
    (elsewhere / "S1").mkdir(parents=True)
    (elsewhere / "S1" / "trace.npz").touch()
    (run / "golden").symlink_to(elsewhere)
    with pytest.raises(MutatorError, match="golden: a link, a pipe"):
        delete_run(run)
    (run / "golden").unlink()
    (run / "plots").mkdir()
    (run / "plots" / "x.svg").symlink_to(elsewhere / "S1" / "trace.npz")
    with pytest.raises(MutatorError, match=r"plots/x\.svg: a link, a pipe"):
        delete_run(run)
    assert (run / "run.json").exists()
    assert (elsewhere / "S1" / "trace.npz").exists()


def test_files_written_during_a_deletion_are_deleted_too(run: Path) -> None:
    assert not finish_deletion(run)
    delete_run(run)
    assert finish_deletion(run)
    (run / "report" / "tables").mkdir(parents=True)
    (run / "report" / "REPORT.md").write_text("of nothing")
    assert finish_deletion(run)
    assert not run.exists()
