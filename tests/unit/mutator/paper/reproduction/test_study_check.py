"""An edited number, in a page or in a table, is found, and so are files that changed since the study."""

import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace

import pytest

from mutator._common.hashing import digest
from mutator.errors import MutatorError
from mutator.paper.reproduction import study_check, study_clone
from mutator.paper.reproduction.page_rendering import StudyPages
from mutator.paper.reproduction.study_campaigns import STUDY, StudyCampaign
from mutator.paper.reproduction.study_check import DATA_SET_FOLDER, StudyCheck, changes_since_study
from mutator.paper.reproduction.study_clone import (
    DIFFERENCES_PAGE,
    FIGURE,
    RESULTS_PAGE,
    TABLES_FOLDER,
    StudyClone,
)
from mutator.paper.reproduction.study_driving import open_study
from mutator.paper.reproduction.study_figure import draw_hazard_shares
from mutator.paper.reproduction.study_tables import Row, StudyTables
from mutator.workspace import Workspace

from .made_up_study import CLONE, made_up_pages, made_up_rows, made_up_tables

Check = Callable[..., list[str]]

BLOCKS = "Text.\n\n<!-- study: summary -->\nobsolete\n<!-- end of study -->\n\nMore.\n"


_FIGURE_BY_COUNTS: dict[str, bytes] = {}


def drawn_once(study: StudyPages) -> bytes:
    """Return the figure; the same counts are drawn only once in all tests."""
    counts = study.fault_types_table("guided", "hazards", "activated")
    if counts not in _FIGURE_BY_COUNTS:
        _FIGURE_BY_COUNTS[counts] = draw_hazard_shares(study)
    return _FIGURE_BY_COUNTS[counts]


@pytest.fixture(autouse=True)
def figures_drawn_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study_check, "draw_hazard_shares", drawn_once)


def git(root: Path, *arguments: str) -> str:
    identity = ("-c", "user.name=a", "-c", "user.email=a@b.c", "-c", "commit.gpgsign=false")
    command = ["git", "-C", str(root), *identity, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.fixture
def clone(tmp_path: Path) -> StudyClone:
    """A clone at the commit of a study, whose pages and tables are those of made-up runs."""
    root = tmp_path / "clone"
    (root / "target").mkdir(parents=True)
    (root / "target" / "car.py").write_text("GAIN = 1\n")
    (root / "README.md").write_text("Read me.\n")
    git(root.parent, "init", "-q", str(root))
    git(root, "add", "-A")
    git(root, "commit", "-q", "-m", "first")
    commit = git(root, "rev-parse", "HEAD")
    study = made_up_pages(commit)
    made_up_tables(commit).write(root / TABLES_FOLDER)
    (root / RESULTS_PAGE).write_text(study.results_page())
    (root / DIFFERENCES_PAGE).write_text(study.with_blocks(BLOCKS))
    (root / FIGURE).write_bytes(drawn_once(study))
    return StudyClone(root=root, commit=commit)


def check_of(root: Path) -> StudyCheck:
    return StudyCheck(docs_root=root, clone_root=CLONE, workspace=Workspace.find(root=CLONE), campaigns=STUDY)


def problems(clone: StudyClone) -> list[str]:
    return list(check_of(clone.root).problems(None))


def test_the_pages_of_this_clone_are_those_of_its_tables() -> None:
    """Both are in the repository, so that each edit of one of them is found here."""
    assert list(check_of(CLONE).problems(None)) == []


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def test_pages_as_they_were_written_have_no_problem(clone: StudyClone) -> None:
    assert problems(clone) == []
    page = (clone.root / DIFFERENCES_PAGE).read_text()
    assert (
        "obsolete" not in page and page.startswith("Text.") and page.endswith("More.\n") and "35.8 %" in page
    )


@pytest.mark.parametrize("name", [RESULTS_PAGE, DIFFERENCES_PAGE])
def test_a_number_of_a_page_edited_by_hand_is_found(clone: StudyClone, name: str) -> None:
    edit(clone.root / name, "35.8 %", "36.8 %")
    [problem] = problems(clone)
    assert problem.startswith(f"{name}:") and "36.8 %" in problem


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [("fault_types.csv", "radar/chaff,480,432", "radar/chaff,480,431"), ("runs.csv", "numpy==2", "numpy==3")],
)
def test_an_edited_table_is_found(clone: StudyClone, name: str, old: str, new: str) -> None:
    """Also where the page does not show the cell: it names the digest of all tables."""
    edit(clone.root / TABLES_FOLDER / name, old, new)
    assert any(RESULTS_PAGE in problem for problem in problems(clone))


def test_another_figure_is_found(clone: StudyClone) -> None:
    edit(clone.root / FIGURE, "#0072b2", "#0072b3")
    assert problems(clone) == [f"{FIGURE}: not the figure of the tables"]


@pytest.mark.parametrize("content", [b"", b"campaign\n", b"campaign,title\r\na,b\r\n", b"\xff"])
def test_a_broken_table_is_refused(clone: StudyClone, content: bytes) -> None:
    (clone.root / TABLES_FOLDER / "runs.csv").write_bytes(content)
    with pytest.raises(MutatorError, match=r"table of the study|not as the study writes it"):
        problems(clone)


def test_changed_files_that_decide_figures_are_named(clone: StudyClone) -> None:
    assert changes_since_study(clone.root, clone)[1] == ()
    (clone.root / "README.md").write_text("Read me again.\n")
    (clone.root / "target" / "car.py").write_text("GAIN = 2\n")
    sentence, deciding = changes_since_study(clone.root, clone)
    assert deciding == ("target/car.py",) and "2 files changed" in sentence and "target/car.py" in sentence
    (clone.root / "target" / "new.py").write_text("")
    assert changes_since_study(clone.root, clone)[1] == ("target/car.py", "target/new.py")


def test_files_that_decide_tables_may_change_between_runs_and_tables(clone: StudyClone) -> None:
    """The runs are of one commit, and the tables are computed later. What changed after that is named."""
    rules = clone.root / "mutator" / "paper" / "rules.py"
    rules.parent.mkdir(parents=True)
    rules.write_text("LEAST = 1\n")
    git(clone.root, "add", "mutator")
    git(clone.root, "commit", "-q", "-m", "rules")
    later = StudyClone(root=clone.root, commit=git(clone.root, "rev-parse", "HEAD"))
    made_up_tables(clone.commit, later.commit).write(clone.root / TABLES_FOLDER)
    assert changes_since_study(clone.root, later)[1] == ()
    rules.write_text("LEAST = 2\n")
    assert changes_since_study(clone.root, later)[1] == ("mutator/paper/rules.py",)


def test_a_study_goes_on_while_no_file_that_decides_runs_has_changed(
    clone: StudyClone, tmp_path: Path
) -> None:
    """Other files may, its own pages and tables also without a commit. It stays of its first commit."""
    out = tmp_path / "study"
    assert open_study(out, clone) == clone.commit
    (clone.root / "README.md").write_text("Read me again.\n")
    git(clone.root, "commit", "-q", "-a", "-m", "words")
    later = StudyClone(root=clone.root, commit=git(clone.root, "rev-parse", "HEAD"))
    assert open_study(out, later) == clone.commit
    assert open_study(tmp_path / "on another machine", later, clone.commit) == clone.commit
    assert open_study(tmp_path / "of an unknown commit", later, "ef" * 20) == later.commit
    (clone.root / "target" / "car.py").write_text("GAIN = 2\n")
    git(clone.root, "commit", "-q", "-a", "-m", "gain")
    with pytest.raises(MutatorError, match=r"a study of commit .*1 differ, such as target/car.py"):
        open_study(out, StudyClone(root=clone.root, commit=git(clone.root, "rev-parse", "HEAD")))
    (clone.root / "target" / "new.py").write_text("")
    with pytest.raises(MutatorError, match=r"not committed \(target/new.py\)"):
        open_study(out, clone)


@pytest.mark.parametrize("is_wheel", [True, False])
def test_without_a_clone_the_study_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_wheel: bool
) -> None:
    if is_wheel:
        (tmp_path / "shipped.zip").touch()
    monkeypatch.setattr(study_clone, "SHIPPED_ARCHIVE_PATH", tmp_path / "shipped.zip")
    monkeypatch.setattr(study_clone, "CLONE_FOLDER", tmp_path)
    with pytest.raises(MutatorError, match="not installed from a git clone"):
        StudyClone.of_this_package()


def test_an_unknown_commit_is_refused(clone: StudyClone) -> None:
    find: Callable[[str], tuple[str, ...]] = clone.files_changed_since
    with pytest.raises(MutatorError, match="is not in this clone"):
        find("ef" * 20)


@pytest.mark.parametrize("name", ["observations.csv", "runs.csv"])
def test_a_table_without_a_row_is_found(clone: StudyClone, name: str) -> None:
    path = clone.root / TABLES_FOLDER / name
    path.write_text("\n".join(path.read_text().splitlines()[:-1]) + "\n")
    assert problems(clone)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [("runs.csv", "11280", "many"), ("fault_types.csv", "radar/chaff,480,432", "radar/chaff,480,")],
)
def test_a_number_that_is_none_is_found(clone: StudyClone, name: str, old: str, new: str) -> None:
    """Also an empty cell, which is a number that the paper does not have."""
    edit(clone.root / TABLES_FOLDER / name, old, new)
    assert problems(clone) == [
        f"{TABLES_FOLDER}: a row or a number is missing, so that no page can be rendered"
    ]


@pytest.mark.parametrize("name", [RESULTS_PAGE, DIFFERENCES_PAGE, FIGURE])
def test_a_missing_page_is_found(clone: StudyClone, name: str) -> None:
    (clone.root / name).unlink()
    assert problems(clone) == [f"{name}: missing"]


def test_a_page_that_is_no_text_is_found(clone: StudyClone) -> None:
    """The page is named, not the tables."""
    (clone.root / RESULTS_PAGE).write_bytes(b"\xff")
    [problem] = problems(clone)
    assert problem.startswith(f"{RESULTS_PAGE}:1: not what the tables give")


@pytest.fixture
def check_with_runs(clone: StudyClone, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Check:
    """Check a clone with a study folder, whose made-up runs give the rows and whose data set has one file."""
    out = tmp_path / "study"
    open_study(out, clone)
    data = b"campaign\n"
    rows: list[Row] = [{"file": "runs.csv", "bytes": str(len(data)), "sha256": digest(data)}]

    def write_data_set(folder: Path, *_: object) -> list[Row]:
        folder.mkdir(exist_ok=True)
        (folder / "runs.csv").write_bytes(data)
        (folder / "SHA256SUMS").write_text(f"{rows[0]['sha256']}  runs.csv\n")
        return rows

    write_data_set(out / DATA_SET_FOLDER)
    tables = made_up_tables(clone.commit)
    StudyTables(rows_by_name=dict(tables.rows_by_name) | {"data_set": rows}).write(clone.root / TABLES_FOLDER)
    monkeypatch.setattr(study_check, "write_data_set", write_data_set)
    monkeypatch.setattr(study_check, "finished_folder", lambda _, campaign, __: campaign.name)
    monkeypatch.setattr(study_check, "seals_of", lambda name: SimpleNamespace(seal=name))
    monkeypatch.setattr(study_check, "rows_of_campaign", lambda c, *_: made_up_rows(c, clone.commit))

    def check(compared: Sequence[StudyCampaign] | None = None) -> list[str]:
        """Return the problems of runs and data set: the pages are those of other rows."""
        problems = check_of(clone.root).problems(out, compared)
        return [each for each in problems if not each.startswith((RESULTS_PAGE, DIFFERENCES_PAGE))]

    return check


@pytest.mark.parametrize(("name", "compared"), [("seeds.csv", None), ("observations_by_seed.csv", STUDY[:1])])
def test_an_invented_row_is_found(
    clone: StudyClone, check_with_runs: Check, name: str, compared: Sequence[StudyCampaign] | None
) -> None:
    """Also one of a campaign that the study does not have, where only some campaigns are compared."""
    path = clone.root / TABLES_FOLDER / name
    *_, last = path.read_text().splitlines()
    path.write_text(f"{path.read_text()}invented{last[last.index(',') :]}\n")
    assert f"{TABLES_FOLDER}/{name}: not what the run folders give" in check_with_runs(compared)


def test_each_machine_compares_what_it_has_driven(clone: StudyClone, check_with_runs: Check) -> None:
    assert check_with_runs(STUDY[:1]) == []
    edit(
        clone.root / TABLES_FOLDER / "fault_types.csv",
        "described,guided,radar/chaff,480",
        "described,guided,radar/chaff,481",
    )
    assert f"{TABLES_FOLDER}/fault_types.csv: not what the run folders give" in check_with_runs(STUDY[:1])


@pytest.mark.parametrize("name", ["runs.csv", "SHA256SUMS", "invented.csv"])
def test_an_edited_file_of_the_data_set_is_found(check_with_runs: Check, tmp_path: Path, name: str) -> None:
    """Also one that was added."""
    assert check_with_runs() == []
    (tmp_path / "study" / DATA_SET_FOLDER / name).write_text("edited\n")
    problem = check_with_runs()[-1]
    assert f"{DATA_SET_FOLDER}/{name}: missing, or not the file whose digest the page names" in problem


def test_a_data_set_edited_with_its_digest_is_found(
    clone: StudyClone, check_with_runs: Check, tmp_path: Path
) -> None:
    """It is written again from the run folders."""
    folder = tmp_path / "study" / DATA_SET_FOLDER
    old, new = digest((folder / "runs.csv").read_bytes()), digest(b"edited\n!")
    (folder / "runs.csv").write_bytes(b"edited\n!")
    edit(folder / "SHA256SUMS", old, new)
    edit(clone.root / TABLES_FOLDER / "data_set.csv", old, new)
    assert check_with_runs() == [f"{folder / 'runs.csv'}: not what the run folders give"]


def test_a_file_that_is_gone_with_its_row_is_found(
    clone: StudyClone, check_with_runs: Check, tmp_path: Path
) -> None:
    folder, table = tmp_path / "study" / DATA_SET_FOLDER, clone.root / TABLES_FOLDER / "data_set.csv"
    (folder / "runs.csv").unlink()
    (folder / "SHA256SUMS").write_text("")
    table.write_text(table.read_text().splitlines()[0] + "\n")
    assert check_with_runs() == [f"{TABLES_FOLDER}/data_set.csv: no row of runs.csv"]


def test_another_commit_in_the_tables_is_found(clone: StudyClone, check_with_runs: Check) -> None:
    """Also where each row has it: the study folder says at which commit its runs were driven."""
    runs = clone.root / TABLES_FOLDER / "runs.csv"
    runs.write_text(runs.read_text().replace(clone.commit, "ab" * 20))
    problem = f"described: the run folder is of commit {clone.commit}, not {'ab' * 20}"
    assert problem in check_with_runs(STUDY[:1])


def test_pages_are_not_compared_before_all_campaigns_have_rows(clone: StudyClone) -> None:
    tables = made_up_tables(clone.commit)
    others = [campaign.name for campaign in STUDY if campaign.name != "described"]
    tables.without_campaigns(others).write(clone.root / TABLES_FOLDER)
    [problem] = problems(clone)
    assert problem.startswith(f"{TABLES_FOLDER}: no rows of coded, coded_2_75, reference, ")


def test_an_exchanged_run_folder_is_a_problem_beside_others(
    clone: StudyClone, check_with_runs: Check, monkeypatch: pytest.MonkeyPatch
) -> None:
    def find(_: Path, campaign: StudyCampaign, __: Workspace) -> str:
        if campaign.name == "coded":
            raise MutatorError("not the campaign 'coded' of the study")
        return campaign.name

    monkeypatch.setattr(study_check, "finished_folder", find)
    edit(clone.root / TABLES_FOLDER / "runs.csv", ",described,", ",exchanged,")
    problems = check_with_runs()
    assert "coded: not the campaign 'coded' of the study" in problems
    assert any(problem.startswith("described: the run folder has the seal") for problem in problems)
