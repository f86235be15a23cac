"""The study that the entry point in `mutator.studies` provides."""

from mutator.figures.figures import Drawing
from mutator.paper.examples import example_drawings
from mutator.paper.panels import observations_panel
from mutator.paper.published import has_paper, load_paper
from mutator.paper.published_checks import check_paper
from mutator.report.studies import ReportedRun, Study
from mutator.statistics.published import Published


def published(run: ReportedRun) -> Published | None:
    """The counts of the paper. None if the library cites none, or if the run has none of the paper's fault
    types."""
    references = run.workspace.library / "references" if run.workspace else None
    if references is None or not has_paper(references):
        return None
    paper = load_paper(references)
    is_of_the_paper = {kind for _, kind in paper.coverage} & set(run.frame["kind"])
    return paper.published() if is_of_the_paper else None


def drawings(run: ReportedRun) -> tuple[Drawing, ...]:
    """The figures of unsafe control actions in single experiments, only for finished runs with published
    fault types."""
    if published(run) is None or len(run.texts) != run.folder.planned:
        return ()
    return example_drawings(run.folder, run.frame, run.workspace)


STUDY = Study(
    about="Rubaiyat, Qin, Alemzadeh: Experimental Resilience Assessment of An Open-Source Driving Agent",
    check=check_paper,
    published=published,
    panels=(observations_panel,),
    drawings=drawings,
)
