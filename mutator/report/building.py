"""Builds the report of a run: REPORT.md and one self-contained HTML page.

The only inputs are the run folder and the fault library. Equal inputs give equal bytes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mutator._common.files import write_atomic
from mutator._common.processes import beside, processes_for
from mutator._common.tables import Table
from mutator._common.text import counted
from mutator.outcomes.counting import outcome_counts
from mutator.outcomes.reader import Results
from mutator.report.browse import Browse, browse_data
from mutator.report.page import Content, markdown, page_html, study_html, study_markdown
from mutator.report.panel import FOLDER, Panel
from mutator.report.panels import PANELS, study_panels
from mutator.report.panels.answers import answers_panel
from mutator.report.stamp import is_current, made_from, remove_stamp, write_stamp
from mutator.report.studies import ReportedRun
from mutator.report.words import words_of
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """The files of a report, and its number of experiments. Only a new report has `summaries`, tables for
    the terminal."""

    markdown: Path
    page: Path
    rows: int
    summaries: tuple[Table, ...] = ()


STUDY_FILES = ("STUDY.md", "study.html")  # written only if the study has panels for this run


def ensure(run: Path, workspace: Workspace | None) -> Report:
    """Write the report of a run folder unless it is up to date."""
    folder, out = RunFolder.open(run), run / FOLDER
    if is_current(out, made_from(folder, workspace)):
        text, hypertext = _files(out)
        return Report(markdown=text, page=hypertext, rows=Results.of_run(run).count())
    return write(run, workspace)


def write(run: Path, workspace: Workspace | None) -> Report:
    """Write the report of a run folder whose results.csv is up to date.

    Without a workspace, no experiments are rerun and no published numbers are shown.
    """
    folder = RunFolder.open(run)
    out = run / FOLDER
    out.mkdir(exist_ok=True)
    remove_stamp(out)
    sources = made_from(folder, workspace)
    reported = ReportedRun.open(folder, workspace)
    with beside(lambda: browse_data(reported), processes_for(len(reported.texts))) as browse:
        study = study_panels(reported)
        content = _content(replace(reported, compared=bool(study)), browse)
    text, hypertext = _files(out)
    _write_study(content, study, out)
    write_atomic(text, markdown(content).encode())
    write_atomic(hypertext, page_html(content).encode())
    write_stamp(out, sources)
    summaries = tuple(panel.summary for panel in (*content.panels, *study) if panel.summary)
    return Report(markdown=text, page=hypertext, rows=len(reported.texts), summaries=summaries)


def _write_study(content: Content, panels: Sequence[Panel], out: Path) -> None:
    """Write the study's page, or remove that of an earlier report."""
    text, hypertext = (out / name for name in STUDY_FILES)
    if not panels:
        text.unlink(missing_ok=True)
        hypertext.unlink(missing_ok=True)
        return
    write_atomic(text, study_markdown(content, panels).encode())
    write_atomic(hypertext, study_html(content, panels).encode())


def _files(out: Path) -> tuple[Path, Path]:
    return out / "REPORT.md", out / "index.html"


def _content(run: ReportedRun, browse: Callable[[], Browse]) -> Content:
    panels = [panel for panel_of in PANELS if (panel := panel_of(run)) is not None]
    return Content(
        name=str(run.folder.head["campaign"]),
        alarm=run.engines.proof if run.engines and run.engines.failed else "",
        outcomes=outcome_counts(run.texts),
        planned=_planned(run.folder),
        words=words_of(run),
        study=run.study.about if run.study and run.compared else "",
        answers=answers_panel(run),
        panels=panels,
        browse=browse(),
    )


def _planned(folder: RunFolder) -> str:
    experiments, runs = int(folder.head["experiments"]), folder.head.get("runs")
    text = f"Planned: {counted(experiments, 'experiment')}"
    if folder.shard:
        text += f", {folder.planned} of them in shard {folder.shard}"
    if runs == experiments:
        text += "; each needs its own run"
    elif runs is not None:  # older plans do not count runs
        text += f", in {counted(runs, 'run')}, because experiments with identical runs share one run"
    return " ".join(filter(None, (f"{text}.", folder.stop_note)))
