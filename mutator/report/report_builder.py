"""Builds the report of a run: REPORT.md, and a self-contained HTML page with others beside it.

The only inputs are the run folder, the fault library, and what is stored beside the report: the change
against the run before, and random searches. Equal inputs give equal bytes.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from mutator._common.confined_files import path_below, write_below
from mutator._common.helper_processes import computing_in_background, process_count_for
from mutator._common.message_text import counted
from mutator._common.table_rendering import TextTable
from mutator.report.change_since_run_before import RUN_BEFORE_FILE, ChangeSinceRunBefore, find_change
from mutator.report.experiment_list_data import ExperimentListData, build_list_data
from mutator.report.panel import REPORT_FOLDER, ReportPage
from mutator.report.panels import LEADING_PANELS, build_pages, build_panels, build_study_page
from mutator.report.panels.answers_panel import build_answers_panel
from mutator.report.panels.first_screen_panel import build_first_screen_panel
from mutator.report.random_searches import RANDOM_SEARCHES_FILE, RandomSearches, find_random_searches
from mutator.report.report_digests import inputs_digest, is_report_current, write_report_files
from mutator.report.report_glossary import glossary_of
from mutator.report.report_markdown_and_html import (
    ReportContent,
    page_html,
    page_markdown,
    report_html,
    report_markdown,
)
from mutator.report.reported_run import ReportedRun
from mutator.report.series_for_report_page import write_missing_series_of_traces
from mutator.report.single_file_report import single_file_html, single_file_name
from mutator.results.outcome_counting import count_by_outcome_or_status
from mutator.results.table_reader import Results
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

MARKDOWN_FILE, PAGE_FILE = "REPORT.md", "index.html"


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenReport:
    """The files of a report, and its number of experiments. Only a new report has `summaries`, tables for
    the terminal; `single_file` is the page that works alone, if it was wanted.
    """

    markdown: Path
    page: Path
    rows: int
    single_file: Path | None = None
    summaries: tuple[TextTable, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class BuiltReport:
    """A report in memory: its `files` by name in the report's folder, of which REPORT.md and index.html
    always exist. `single_file` is the page that works alone, if it was wanted.
    """

    files: Mapping[str, bytes]
    single_file: bytes | None
    experiment_count: int
    summaries: tuple[TextTable, ...]


def ensure_report(run: Path, workspace: Workspace | None) -> WrittenReport:
    """Write the report of a run folder unless it is up to date."""
    if not is_report_current(run, inputs_digest(RunFolder.open(run), workspace)):
        return write_report(run, workspace)
    return _written_report(run, Results(run).row_count())


def write_report(run: Path, workspace: Workspace | None, *, single_file: bool = False) -> WrittenReport:
    """Write the report of a run folder whose tables are up to date, and missing series of kept traces.

    With `single_file`, also write a page that works alone, into exports/. Without a workspace, no experiments
    are rerun and no published numbers are shown.
    """
    folder = RunFolder.open(run)
    if workspace:
        write_missing_series_of_traces(folder, workspace)
    sources = inputs_digest(folder, workspace)
    change = find_change(folder, Results(run).frame())
    built = build_report(
        folder,
        workspace,
        single_file=single_file,
        change=change,
        random_searches=find_random_searches(folder, workspace),
    )
    write_report_files(run, sources, built.files)
    written = _written_report(run, built.experiment_count, built.summaries)
    if built.single_file is None:
        return written
    name = single_file_name(folder.path.resolve().name)
    write_below(run, name, built.single_file)
    return replace(written, single_file=path_below(run, name))


def build_report(
    folder: RunFolder,
    workspace: Workspace | None,
    *,
    single_file: bool = False,
    change: ChangeSinceRunBefore | None = None,
    random_searches: RandomSearches | None = None,
) -> BuiltReport:
    """Build the report of a run folder whose tables are up to date, without writing anything. `change` is
    that against the run before, and `random_searches` are those beside a search, if the report shows them.
    """
    beside = random_searches or RandomSearches()
    reported = replace(ReportedRun.open(folder, workspace), change=change, random_searches=beside.searches)
    with computing_in_background(
        lambda: build_list_data(reported), process_count_for(len(reported.results))
    ) as wait_for_list_data:
        study = build_study_page(reported)
        content = _build_content(replace(reported, has_study_page=bool(study)), study, wait_for_list_data)
    panels = (
        *content.leading_panels,
        *content.on_one_page().panels,
        *(study.panels if study else ()),
    )
    files = {name: data for panel in panels for name, data in panel.files.items()}
    files |= {MARKDOWN_FILE: report_markdown(content).encode(), PAGE_FILE: report_html(content).encode()}
    files |= {page.file_name: page_html(content, page).encode() for page in content.all_pages}
    if change:
        files |= {RUN_BEFORE_FILE: change.as_bytes()}
    if beside.searches:
        files |= {RANDOM_SEARCHES_FILE: beside.as_bytes()}
    if study:
        files |= {"STUDY.md": page_markdown(content, study).encode()}
    summaries = tuple(panel.summary for panel in panels if panel.summary)
    return BuiltReport(
        files=files,
        single_file=single_file_html(content, reported).encode() if single_file else None,
        experiment_count=len(reported.results),
        summaries=summaries,
    )


def _written_report(run: Path, rows: int, summaries: tuple[TextTable, ...] = ()) -> WrittenReport:
    out = run / REPORT_FOLDER
    return WrittenReport(markdown=out / MARKDOWN_FILE, page=out / PAGE_FILE, rows=rows, summaries=summaries)


def _build_content(
    run: ReportedRun, study: ReportPage | None, wait_for_list_data: Callable[[], ExperimentListData]
) -> ReportContent:
    return ReportContent(
        title=run.folder.head.campaign,
        alarm=run.engine_summary.equivalence_text
        if run.engine_summary and run.engine_summary.has_failed_equivalence
        else "",
        outcome_counts=count_by_outcome_or_status(run.results),
        plan_text=_describe_plan(run.folder),
        glossary=glossary_of(run),
        leading_panels=build_panels(run, LEADING_PANELS),
        first_screen=build_first_screen_panel(run),
        answers=build_answers_panel(run),
        panels=build_panels(run),
        pages=build_pages(run),
        study=study,
        experiment_list=wait_for_list_data(),
    )


def _describe_plan(folder: RunFolder) -> str:
    experiments, runs = folder.head.experiments, folder.head.runs
    text = f"Planned: {counted(experiments, 'experiment')}"
    if folder.shard:
        text += f", {folder.planned_experiment_count} of them in shard {folder.shard}"
    if runs == experiments:
        text += ", no two with identical runs"
    else:
        text += f", in {counted(runs, 'run')}, because experiments with identical runs share one run"
    return " ".join(filter(None, (f"{text}.", folder.early_end_note)))
