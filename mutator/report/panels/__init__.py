"""The panels of every report. To add a panel, write a module and list its function in `PANELS`. The function
returns None if there is nothing to show.
"""

from collections.abc import Callable

from mutator._common.doors import STUDIES
from mutator.report.panel import Panel
from mutator.report.panels import (
    failed_runs_panel,
    fault_paths_panel,
    figures_panel,
    mutation_score_panel,
    provenance_panel,
    seeds_panel,
    source_panel,
    tables_panel,
)
from mutator.report.reported_run import ReportedRun

PANELS: tuple[Callable[[ReportedRun], Panel | None], ...] = (
    mutation_score_panel.build_mutation_score_panel,
    source_panel.build_source_panel,
    fault_paths_panel.build_fault_paths_panel,
    tables_panel.build_tables_panel,
    seeds_panel.build_seeds_panel,
    figures_panel.build_figures_panel,
    failed_runs_panel.build_failed_runs_panel,
    provenance_panel.build_provenance_panel,
)


def build_study_panels(run: ReportedRun) -> tuple[Panel, ...]:
    """Return the panels of the study's page: those of the study, then the run's tables and figures next to
    the published ones. Empty if the run has too few experiments or none of the study's faults.
    """
    if not run.published_work:
        return ()
    with STUDIES.blaming_package(run.folder.head.study or ""):
        panels = [panel for build_panel in run.published_work.panels if (panel := build_panel(run))]
        general_panels = (
            (tables_panel.build_published_comparison_panel(run), figures_panel.build_study_figures_panel(run))
            if panels
            else ()
        )
    return (*panels, *(panel for panel in general_panels if panel))
