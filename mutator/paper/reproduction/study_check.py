"""Checks that pages, tables, runs and data set of the study belong together, and what has changed since."""

import csv
import io
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from mutator._common.bounded_reading import read_bounded
from mutator._common.message_text import counted
from mutator.audit.run_digests_and_seal import seals_of
from mutator.errors import MutatorError
from mutator.paper.published_numbers import load_published_numbers
from mutator.paper.reproduction.campaign_tables import rows_of_campaign
from mutator.paper.reproduction.data_set import (
    differing_files,
    files_of_campaigns,
    has_same_content,
    write_data_set,
)
from mutator.paper.reproduction.page_rendering import StudyPages
from mutator.paper.reproduction.study_campaigns import StudyCampaign
from mutator.paper.reproduction.study_clone import (
    DIFFERENCES_PAGE,
    FIGURE,
    RESULTS_PAGE,
    TABLES_FOLDER,
    StudyClone,
    deciding_files,
    files_deciding_runs,
    files_deciding_study,
)
from mutator.paper.reproduction.study_driving import commit_of_study, finished_folder
from mutator.paper.reproduction.study_figure import draw_hazard_shares
from mutator.paper.reproduction.study_tables import StudyTables, combined, load_tables
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

OTHER_FIGURES_FILE = "docs/explanation/figures.csv"
DATA_SET_FOLDER = "data_set"
_MOST_NAMED = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyCheck:
    """What a check of the pages in `docs_root` compares: the folder that has `docs/`. `clone_root` has the
    licence that is in the data set, too.
    """

    docs_root: Path
    clone_root: Path
    workspace: Workspace
    campaigns: Sequence[StudyCampaign]

    def problems(self, out: Path | None, compared: Collection[StudyCampaign] | None = None) -> Iterator[str]:
        """Yield each difference between tables, pages and, with a study folder, its runs and data set.
        `compared` are the campaigns whose runs and files of the data set are in the folder; None: all.
        """
        tables = load_tables(self.docs_root / TABLES_FOLDER)
        if missing := campaigns_without_rows(self.campaigns, tables):
            without = ", ".join(missing)
            yield f"{TABLES_FOLDER}: no rows of {without}; until it has them, the pages show older runs"
        else:
            try:
                yield from list(self._page_problems(tables))
            except (KeyError, TypeError, ValueError):
                yield f"{TABLES_FOLDER}: a row or a number is missing, so that no page can be rendered"
                return
        if out is None:
            return
        folders = {}
        for campaign in self.campaigns if compared is None else compared:
            try:
                folders[campaign.name] = finished_folder(out, campaign, self.workspace)
            except MutatorError as err:
                yield f"{campaign.name}: {err}"
        yield from self._run_problems(tables, out, folders)
        yield from self._data_set_problems(tables, out / DATA_SET_FOLDER, folders)

    def _page_problems(self, tables: StudyTables) -> Iterator[str]:
        missing = [n for n in (RESULTS_PAGE, DIFFERENCES_PAGE, FIGURE) if not (self.docs_root / n).is_file()]
        yield from (f"{name}: missing" for name in missing)
        if missing:
            return
        study = pages_of(self.workspace, self.campaigns, tables)
        page = read_bounded(self.docs_root / RESULTS_PAGE).decode(errors="replace")
        yield from _differences(RESULTS_PAGE, page, study.results_page())
        page = read_bounded(self.docs_root / DIFFERENCES_PAGE).decode(errors="replace")
        yield from _differences(DIFFERENCES_PAGE, page, study.with_blocks(page))
        if read_bounded(self.docs_root / FIGURE) != draw_hazard_shares(study):
            yield f"{FIGURE}: not the figure of the tables"

    def _run_problems(
        self, tables: StudyTables, out: Path, folders: Mapping[str, RunFolder]
    ) -> Iterator[str]:
        commit, tables_commit, of_study = "", "", commit_of_study(out)
        names = {campaign.name for campaign in self.campaigns}
        for row in tables.rows("runs"):
            commit, tables_commit = row["commit"], row["tables_commit"]
            folder = folders.get(row["campaign"])
            if row["campaign"] not in names:
                yield f"{TABLES_FOLDER}/runs.csv: the study has no campaign '{row['campaign']}'"
            elif folder and (seal := seals_of(folder).seal) != row["seal"]:
                yield f"{row['campaign']}: the run folder has the seal {seal}, not {row['seal']}"
            if folder and commit != of_study:
                yield f"{row['campaign']}: the run folder is of commit {of_study}, not {commit}"
        again = combined(
            rows_of_campaign(each, folders[each.name], self.workspace, commit, tables_commit)
            for each in self.campaigns
            if each.name in folders
        )
        for name in tables.without_campaigns(names - set(folders)).different_tables(again):
            yield f"{TABLES_FOLDER}/{name}: not what the run folders give"

    def _data_set_problems(
        self, tables: StudyTables, folder: Path, folders: Mapping[str, RunFolder]
    ) -> Iterator[str]:
        """Write the data set again, elsewhere, and compare contents; then compare digests."""
        rows = tables.rows("data_set")
        if not all(row["bytes"].isdecimal() for row in rows):
            yield f"{TABLES_FOLDER}/data_set.csv: a size that is no number"
            return
        with TemporaryDirectory() as temporary:
            again = write_data_set(Path(temporary), self.clone_root, self.campaigns, folders, tables)
            for name in sorted({row["file"] for row in again} - {row["file"] for row in rows}):
                yield f"{TABLES_FOLDER}/data_set.csv: no row of {name}"
            for name in (row["file"] for row in again):
                if (folder / name).is_file() and not has_same_content(folder / name, Path(temporary, name)):
                    yield f"{folder / name}: not what the run folders give"
        elsewhere = files_of_campaigns(each for each in self.campaigns if each.name not in folders)
        for name in differing_files(folder, rows, may_be_missing=elsewhere):
            yield f"{folder / name}: missing, or not the file whose digest the page names"


def campaigns_without_rows(campaigns: Iterable[StudyCampaign], tables: StudyTables) -> list[str]:
    """Return the names of campaigns that are not driven yet, as far as the tables say."""
    return [each.name for each in campaigns if not tables.rows("runs", campaign=each.name)]


def pages_of(workspace: Workspace, campaigns: Sequence[StudyCampaign], tables: StudyTables) -> StudyPages:
    published = load_published_numbers(workspace.references)
    return StudyPages(tables=tables, campaigns=campaigns, published=published)


def _differences(name: str, page: str, rendered: str) -> Iterator[str]:
    """Yield the first line in which a page differs from what the tables give."""
    if page == rendered:
        return
    got, expected = page.splitlines(), rendered.splitlines()
    for number, (line, expected_line) in enumerate(zip(got, expected, strict=False), start=1):
        if line != expected_line:
            yield f"{name}:{number}: not what the tables give\n  is:     {line}\n  should: {expected_line}"
            return
    yield f"{name}: {len(got)} lines, and the tables give {len(expected)}"


def changes_since_study(docs_root: Path, clone: StudyClone) -> tuple[str, tuple[str, ...]]:
    """Return sentences on what changed since the study's commits, and the files that decide its figures."""
    pairs = {
        (row["commit"], row["tables_commit"]) for row in load_tables(docs_root / TABLES_FOLDER).rows("runs")
    }
    if len(pairs) != 1:
        raise MutatorError("runs of different commits", where=docs_root / TABLES_FOLDER / "runs.csv")
    [(commit, tables_commit)] = pairs
    changed, changed_later = clone.files_changed_since(commit), clone.files_changed_since(tables_commit)
    of_runs, of_tables = files_deciding_runs(changed), files_deciding_study(changed_later)
    sentences = (
        f"runs of {commit[:12]}: {counted(len(changed), 'file')} changed since, besides pages and tables; "
        f"{len(of_runs)} can decide a run{_named(of_runs)}",
        f"tables of {tables_commit[:12]}: {counted(len(changed_later), 'file')} changed since; "
        f"{len(of_tables)} can decide a figure{_named(of_tables)}",
    )
    return "\n".join(sentences), tuple(dict.fromkeys((*of_runs, *of_tables)))


def other_figures(docs_root: Path, clone: StudyClone) -> Iterator[str]:
    """Yield a sentence for each other figure of the docs with a commit: how much has changed since."""
    text = read_bounded(docs_root / OTHER_FIGURES_FILE).decode()
    for row in csv.DictReader(io.StringIO(text, newline="")):
        if row["commit"]:
            changed = deciding_files(clone.files_changed_since(row["commit"]))
            files = (
                f"{counted(len(changed), 'deciding file')} changed since {row['commit']}"
                if changed
                else "current"
            )
            yield f"{row['page']}, {row['figure']}: {files}"


def _named(files: Sequence[str]) -> str:
    if not files:
        return ""
    more = f" and {len(files) - _MOST_NAMED} more" if len(files) > _MOST_NAMED else ""
    return f": {', '.join(files[:_MOST_NAMED])}{more}"
