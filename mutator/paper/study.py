"""The study that the entry point in `mutator.studies` provides."""

from mutator.figures.drawings import Drawing
from mutator.paper.example_figures import example_drawings
from mutator.paper.observations_panel import build_observations_panel
from mutator.paper.published_numbers import has_paper, load_paper
from mutator.paper.published_numbers_check import check_paper
from mutator.report.reported_run import PublishedWork, ReportedRun
from mutator.statistics.published_counts import PublishedCounts


def published(run: ReportedRun) -> PublishedCounts | None:
    """Return the paper's counts if the library cites them and the run has any of the paper's fault types."""
    references = run.workspace.references if run.workspace else None
    if references is None or not has_paper(references):
        return None
    paper = load_paper(references)
    is_of_the_paper = {kind for _, kind in paper.coverage} & set(run.frame["kind"])
    return paper.published() if is_of_the_paper else None


def drawings(run: ReportedRun) -> tuple[Drawing, ...]:
    """Return the figures of unsafe control actions, only for finished runs with published fault types."""
    if published(run) is None or len(run.results) != run.folder.planned:
        return ()
    return example_drawings(run.folder, run.frame, run.workspace)


STUDY = PublishedWork(
    about="Rubaiyat, Qin, Alemzadeh: Experimental Resilience Assessment of An Open-Source Driving Agent",
    check=check_paper,
    published=published,
    panels=(build_observations_panel,),
    drawings=drawings,
)
