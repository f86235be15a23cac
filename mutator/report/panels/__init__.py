"""The panels of every report, one module each; a new one is a module here and its line in `PANELS`.

A panel is made by a function from `ReportedRun` to `Panel`, or to None where there is nothing to say.
"""

from collections.abc import Callable

from mutator.report.panel import Panel
from mutator.report.panels import failed, figures, mutation_score, origin, paths, seeds, source, tables
from mutator.report.studies import ReportedRun

PANELS: tuple[Callable[[ReportedRun], Panel | None], ...] = (
    mutation_score.score_panel,
    source.source_panel,
    paths.paths_panel,
    tables.tables_panel,
    seeds.seeds_panel,
    figures.figures_panel,
    failed.failed_panel,
    origin.origin_panel,
)


def study_panels(run: ReportedRun) -> tuple[Panel, ...]:
    """The page of a run's study: what it says of these results, tables and figures beside the published ones.

    Empty where the study has nothing to say: too few experiments, or none of its faults.
    """
    said = [panel for panel_of in run.study.panels if (panel := panel_of(run))] if run.study else []
    if not said:
        return ()
    beside = (tables.published_panel(run), figures.study_figures(run))
    return (*said, *(panel for panel in beside if panel))
