"""The panels of every report. To add a panel, write a module and list its function in `PANELS`, or on one of
the pages beside the report. The function returns None if there is nothing to show.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple

from mutator._common.extension_doors import STUDY_DOOR
from mutator.report.panel import Panel, ReportPage
from mutator.report.panels import (
    defences_panel,
    envelopes_panel,
    failed_runs_panel,
    families_panel,
    fault_paths_panel,
    figures_panel,
    findings_panel,
    mutation_score_panel,
    provenance_panel,
    seeds_panel,
    source_panel,
    tables_panel,
    values_panel,
)
from mutator.report.reported_run import ReportedRun

PanelBuilder = Callable[[ReportedRun], Panel | None]

LEADING_PANELS: tuple[PanelBuilder, ...] = (  # before all others
    defences_panel.build_defences_panel,
    envelopes_panel.build_envelopes_panel,
    findings_panel.build_findings_panel,
)

PANELS: tuple[PanelBuilder, ...] = (
    families_panel.build_families_panel,
    values_panel.build_values_panel,
    mutation_score_panel.build_mutation_score_panel,
    source_panel.build_source_panel,
    fault_paths_panel.build_fault_paths_panel,
    failed_runs_panel.build_failed_runs_panel,
)


class PlannedPage(NamedTuple):
    file_name: str
    link: str
    about: str
    panel_builders: tuple[PanelBuilder, ...]


PLANNED_PAGES = (
    PlannedPage(
        "tables.html",
        "Tables",
        "Counts and statistics of this run, with their intervals. Each table is also a file in `tables/`.",
        (tables_panel.build_tables_panel, seeds_panel.build_seeds_panel),
    ),
    PlannedPage(
        "figures.html",
        "Figures",
        "Each figure is also a file in `figures/`.",
        (figures_panel.build_figures_panel,),
    ),
    PlannedPage(
        "origin.html",
        "Origin",
        "How the experiments were run, and the digests, versions and choices that reproduce them.",
        (provenance_panel.build_provenance_panel,),
    ),
)


def build_panels(run: ReportedRun, panel_builders: Iterable[PanelBuilder] = PANELS) -> tuple[Panel, ...]:
    return tuple(panel for build_panel in panel_builders if (panel := build_panel(run)) is not None)


def build_pages(run: ReportedRun) -> tuple[ReportPage, ...]:
    """Return the pages beside the report, without those that have nothing to show."""
    pages = (
        ReportPage(
            file_name=page.file_name,
            link=page.link,
            title=page.link,
            about=page.about,
            panels=build_panels(run, page.panel_builders),
        )
        for page in PLANNED_PAGES
    )
    return tuple(page for page in pages if page.panels)


def build_study_page(run: ReportedRun) -> ReportPage | None:
    """Return the study's page: the study's panels, then the run's tables and figures next to the published
    ones. None if the run has too few experiments or none of the study's faults.
    """
    if not run.published_work:
        return None
    with STUDY_DOOR.blaming_package(run.folder.head.study or ""):
        panels = build_panels(run, run.published_work.panels)
        if not panels:
            return None
        general = (tables_panel.build_published_comparison_panel, figures_panel.build_study_figures_panel)
        return ReportPage(
            file_name="study.html",
            link="Study",
            title="Compared with the study",
            about=f"{run.published_work.about}.",
            panels=(*panels, *build_panels(run, general)),
        )
