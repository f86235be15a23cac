"""Reproduces the published study: drives its campaigns, and writes the pages, tables and data set about them.

    python -m mutator.paper.reproduce --out DIR            # drive what is missing, then write
    python -m mutator.paper.reproduce --check [--out DIR]  # compare what is written, and say what has changed

`--only NAME` drives or compares one campaign, so that machines can share the work, one after the other, each
with the tables that the one before wrote. Pages are written once all campaigns have rows.

`--small` drives a few faults in each campaign, to try the whole way in minutes. It writes its pages into DIR
instead of the clone.
"""

import argparse
import sys
import warnings
from collections.abc import Collection, Sequence
from functools import partial
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.cpu_cores import usable_cores
from mutator._common.files import make_folder, write_atomic
from mutator.errors import MutatorError, MutatorWarning
from mutator.paper.reproduction.campaign_tables import rows_of_campaign
from mutator.paper.reproduction.data_set import write_data_set
from mutator.paper.reproduction.page_rendering import StudyPages
from mutator.paper.reproduction.study_campaigns import STUDY, StudyCampaign
from mutator.paper.reproduction.study_check import (
    DATA_SET_FOLDER,
    StudyCheck,
    campaigns_without_rows,
    changes_since_study,
    other_figures,
    pages_of,
)
from mutator.paper.reproduction.study_clone import (
    DIFFERENCES_PAGE,
    FIGURE,
    RESULTS_PAGE,
    TABLES_FOLDER,
    StudyClone,
)
from mutator.paper.reproduction.study_driving import drive_study, finished_folder, is_driven, open_study
from mutator.paper.reproduction.study_figure import draw_hazard_shares
from mutator.paper.reproduction.study_tables import StudyTables, combined, load_tables
from mutator.workspace import Workspace


def write_study(
    workspace: Workspace,
    campaigns: Sequence[StudyCampaign],
    out: Path,
    clone: StudyClone,
    commit: str,
    docs_root: Path,
) -> list[str]:
    """Write tables and data set of the campaigns that are finished in `out`, driven at `commit`, and once all
    campaigns have rows, pages and figure. Return the names of those without.

    Other campaigns keep their rows in the tables, if the same files decide these.
    """
    folders = {each.name: finished_folder(out, each, workspace) for each in campaigns if is_driven(out, each)}
    earlier = _tables_to_keep(_earlier_tables(docs_root), commit, clone)
    tables_commit = next((row["tables_commit"] for row in earlier.rows("runs")), clone.commit)
    parts = [
        rows_of_campaign(each, folders[each.name], workspace, commit, tables_commit)
        if each.name in folders
        else earlier.of_campaign(each.name)
        for each in campaigns
    ]
    try:
        so_far = combined([*parts, {"data_set": earlier.rows("data_set")}])
        rows = write_data_set(out / DATA_SET_FOLDER, clone.root, campaigns, folders, so_far)
        tables = combined([*parts, {"data_set": rows}])
        missing = campaigns_without_rows(campaigns, tables)
        pages = {} if missing else _rendered_pages(pages_of(workspace, campaigns, tables), clone)
    except (KeyError, TypeError, ValueError) as err:
        if not earlier.rows("runs"):
            raise
        raise MutatorError(
            f"rows of other machines with a gap or a wrong number ({err})",
            where=docs_root / TABLES_FOLDER,
            remedy="restore the tables that they wrote",
        ) from err
    tables.write(docs_root / TABLES_FOLDER)
    for name, data in pages.items():
        make_folder((docs_root / name).parent)
        write_atomic(docs_root / name, data)
    return missing


def _earlier_tables(docs_root: Path) -> StudyTables:
    """Return the tables that are there; empty ones if a file is missing or broken."""
    try:
        return load_tables(docs_root / TABLES_FOLDER)
    except MutatorError:
        return combined([])


def _tables_to_keep(tables: StudyTables, commit: str, clone: StudyClone) -> StudyTables:
    """Return tables of runs at a commit, if this clone would compute the same; otherwise empty ones, with a
    MutatorWarning.
    """
    commits = {(row["commit"], row["tables_commit"]) for row in tables.rows("runs")}
    if not commits or commits == {(commit, clone.commit)}:
        return tables
    [(runs_commit, tables_commit), *others] = commits
    if not others and runs_commit == commit and clone.decides_figures_as(tables_commit):
        return tables
    names = ", ".join(row["campaign"] for row in tables.rows("runs"))
    warnings.warn(
        f"earlier rows of {names} are left out: other files decided them than those of runs at {commit[:12]} "
        f"and tables at {clone.commit[:12]}",
        MutatorWarning,
        stacklevel=2,
    )
    return combined([])


def _rendered_pages(study: StudyPages, clone: StudyClone) -> dict[str, bytes]:
    differences = read_bounded(clone.root / DIFFERENCES_PAGE).decode()
    return {
        RESULTS_PAGE: study.results_page().encode(),
        DIFFERENCES_PAGE: study.with_blocks(differences).encode(),
        FIGURE: draw_hazard_shares(study),
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code: 1 if a check found a difference, 2 for wrong input."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, metavar="DIR", help="the folder of the study")
    parser.add_argument("-n", "--workers", type=int, default=usable_cores(), help="worker processes")
    parser.add_argument(
        "--only",
        action="append",
        choices=[each.name for each in STUDY],
        help="only this campaign; can be given several times",
    )
    parser.add_argument("--check", action="store_true", help="drive and write nothing: compare")
    parser.add_argument("--small", action="store_true", help="a few faults of each campaign, pages into DIR")
    options = parser.parse_args(arguments)
    if options.out is None and (options.small or not options.check):
        parser.error("--out DIR is needed to drive")
    try:
        return _run(options)
    except MutatorError as err:
        print(f"error: {err}", file=sys.stderr)
        return 2


def _run(options: argparse.Namespace) -> int:
    clone = StudyClone.of_this_package()
    workspace = Workspace.find(clone.root)
    docs_root = options.out / "pages" if options.small else clone.root
    campaigns = [each.small() for each in STUDY] if options.small else STUDY
    chosen = [each for each in campaigns if each.name in options.only] if options.only else None
    if options.check:
        check = StudyCheck(
            docs_root=docs_root, clone_root=clone.root, workspace=workspace, campaigns=campaigns
        )
        return _check(check, options.out, chosen, clone)
    elsewhere = next((row["commit"] for row in _earlier_tables(docs_root).rows("runs")), "")
    open_study(options.out, clone, elsewhere)
    tell = partial(print, flush=True)
    drive_study(workspace, chosen or campaigns, options.out, workers=options.workers, tell=tell)
    if (now := StudyClone.of_this_package()).commit != clone.commit:
        raise MutatorError(
            f"another commit, {now.commit[:12]}, was checked out meanwhile",
            where=clone.root,
            remedy="repeat the command",
        )
    commit = open_study(options.out, clone)
    missing = write_study(workspace, campaigns, options.out, clone, commit, docs_root)
    data_set = options.out / DATA_SET_FOLDER
    if missing:
        print(f"written: {docs_root / TABLES_FOLDER}, {data_set}; pages need {', '.join(missing)}, too")
    else:
        print(f"written: {docs_root / RESULTS_PAGE}, tables, figure, and {data_set}")
    return 0


def _check(
    check: StudyCheck, out: Path | None, chosen: Collection[StudyCampaign] | None, clone: StudyClone
) -> int:
    problems: list[str] = []
    deciding: tuple[str, ...] = ()
    if (check.docs_root / TABLES_FOLDER).is_dir():
        problems = list(check.problems(out, chosen))
        sentence, deciding = changes_since_study(check.docs_root, clone)
    else:
        problems.append(f"{TABLES_FOLDER}: missing; the pages show older runs, until the study is driven")
        sentence = "figures that have other commands:"
    for line in (*problems, sentence, *other_figures(clone.root, clone)):
        print(line)
    if not problems:
        print("pages, tables" + (", run folders and data set" if out else "") + " belong together")
    return 1 if problems or deciding else 0


if __name__ == "__main__":
    sys.exit(main())
