"""The study that the entry point in `mutator.studies` provides."""

from mutator.figures.drawings import Drawing
from mutator.paper.example_experiment_figures import build_example_drawings
from mutator.paper.observations_panel import build_observations_panel
from mutator.paper.published_numbers import has_published_numbers, load_published_numbers
from mutator.paper.published_numbers_check import check_published_numbers
from mutator.report.reported_run import PublishedWork, ReportedRun
from mutator.statistics.published_counts import PublishedCounts


def published_counts_for(run: ReportedRun) -> PublishedCounts | None:
    """Return the paper's counts if the library cites them and the run has any of the paper's fault types."""
    references = run.workspace.references if run.workspace else None
    if references is None or not has_published_numbers(references):
        return None
    numbers = load_published_numbers(references)
    shared_fault_types = {kind for _, kind in numbers.tally_by_fault_type} & set(run.frame["kind"])
    return numbers.as_published_counts() if shared_fault_types else None


def example_drawings_for(run: ReportedRun) -> tuple[Drawing, ...]:
    """Return the figures of unsafe control actions, only for finished runs with published fault types."""
    if published_counts_for(run) is None or len(run.results) != run.folder.planned_experiment_count:
        return ()
    return build_example_drawings(run.folder, run.frame, run.workspace)


STUDY = PublishedWork(
    about="Rubaiyat, Qin, Alemzadeh: Experimental Resilience Assessment of An Open-Source Driving Agent",
    check=check_published_numbers,
    published=published_counts_for,
    panels=(build_observations_panel,),
    drawings=example_drawings_for,
)
