"""The panels of every report, one module each; a new one is a module here and its line in `PANELS`.

A panel is made by a function from `ReportedRun` to `Panel`, or to None where there is nothing to say.
"""

from collections.abc import Callable

from mutator.report.panel import Panel
from mutator.report.panels import failed, figures, origin, tables
from mutator.report.studies import ReportedRun

PANELS: tuple[Callable[[ReportedRun], Panel | None], ...] = (
    tables.tables_panel,
    figures.figures_panel,
    failed.failed_panel,
    origin.origin_panel,
)
