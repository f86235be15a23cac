"""The panels of every report. To add a panel, write a module and list its function in `PANELS`. The function
returns None if there is nothing to show.
"""

from collections.abc import Callable

from mutator._common.doors import STUDIES
from mutator.report.panel import Panel
from mutator.report.panels import failed, figures, mutation_score, paths, provenance, seeds, source, tables
from mutator.report.studies import ReportedRun

PANELS: tuple[Callable[[ReportedRun], Panel | None], ...] = (
    mutation_score.score_panel,
    source.source_panel,
    paths.paths_panel,
    tables.tables_panel,
    seeds.seeds_panel,
    figures.figures_panel,
    failed.failed_panel,
    provenance.provenance_panel,
)


def study_panels(run: ReportedRun) -> tuple[Panel, ...]:
    """Return the panels of the study's page: those of the study, then the run's tables and figures next to
    the published ones. Empty if the run has too few experiments or none of the study's faults.
    """
    if not run.study:
        return ()
    with STUDIES.running(run.folder.head.study or ""):
        said = [panel for panel_of in run.study.panels if (panel := panel_of(run))]
        beside = (tables.published_panel(run), figures.study_figures(run)) if said else ()
    return (*said, *(panel for panel in beside if panel))
