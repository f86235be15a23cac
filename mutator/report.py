"""The report of a run: REPORT.md, and one HTML page that needs nothing but its figures, patches and plots.

Written from results.csv and the run folder, so it can be made again at any time, the same each time; the
published numbers that statistics stand beside come from the library.
"""

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from mutator import tables
from mutator.jsonio import write_atomic
from mutator.model import Status
from mutator.runfolder import RunFolder
from mutator.tables import Count, Row

if TYPE_CHECKING:
    from mutator.figures.figures import Drawing
    from mutator.statistics.sheet import Sheet

FOLDER = "report"
PACKAGES = ("jinja2", "libcst", "numpy")  # what makes mutants and compares runs; run.json has all packages


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """Where a report was written, and of how many experiments it tells."""

    markdown: Path
    page: Path
    rows: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of counts, ready to be printed."""

    title: str
    heads: list[str]
    lines: list[list[str]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One experiment in the page: its row, and where its diff, plot and stills are seen from the report."""

    row: Row
    patch: str | None
    plot: str | None
    stills: tuple[tuple[str, str], ...]  # (time, link)


@dataclass(frozen=True, slots=True, kw_only=True)
class Content:
    """What both forms of the report say."""

    name: str
    facts: list[tuple[str, str]]
    outcomes: dict[str, int]
    tables: list[Table]
    statistics: "tuple[Sheet, ...]"  # written as files of their own, too
    figures: "tuple[Drawing, ...]"  # written as files that the report shows
    failed: list[Row]  # runs that did not end well, harness errors first
    experiments: list[Line]


def write(run: Path) -> Report:
    """Write the report of a run folder whose results.csv is up to date."""
    from mutator.figures import figures
    from mutator.report_page import markdown, page
    from mutator.statistics import sheets
    from mutator.statistics.frame import load

    folder = RunFolder.open(run)
    rows = tables.read_results(run / "results.csv")
    out = run / FOLDER
    out.mkdir(exist_ok=True)
    statistics = sheets.run_sheets(folder)
    sheets.write(statistics, out)
    drawings = figures.drawings(load(run / "results.csv"))
    figures.write(drawings, out)
    content = _content(folder, rows, statistics, drawings)
    report = Report(markdown=out / "REPORT.md", page=out / "index.html", rows=len(rows))
    write_atomic(report.markdown, markdown(content).encode())
    write_atomic(report.page, page(content).encode())
    return report


def _content(
    folder: RunFolder,
    rows: Sequence[Row],
    statistics: "tuple[Sheet, ...]",
    drawings: "tuple[Drawing, ...]",
) -> Content:
    failed = [r for r in rows if r.status is not Status.OK]
    return Content(
        name=str(folder.head["campaign"]),
        facts=_facts(folder, rows),
        outcomes=tables.outcome_counts(rows),
        tables=_tables(rows),
        statistics=statistics,
        figures=drawings,
        failed=sorted(
            failed, key=lambda r: (r.status is not Status.HARNESS_ERROR, r.status, r.experiment_id)
        ),
        experiments=[_line(folder, row) for row in sorted(rows, key=_reading_order)],
    )


def _facts(folder: RunFolder, rows: Sequence[Row]) -> list[tuple[str, str]]:
    """What the results come from, and what they could be made again with."""
    head, versions = folder.head, folder.provenance
    facts = {
        "experiments": f"{len(rows)} of {folder.planned} planned",
        "campaign": head["campaign"],
        "plan": head["plan"],
        "seed": head["seed"],
        "reading": head["reading"],
        **{f"chosen: {name}": value for name, value in head["choices"].items() if value is not None},
        **{f"digest of {name}": value for name, value in head["sources"].items()},
        **{name: versions[name] for name in ("mutator", "python", "machine")},
        **{name: versions["packages"][name] for name in PACKAGES if name in versions["packages"]},
    }
    return [(name, str(value)) for name, value in facts.items()]


def _tables(rows: Sequence[Row]) -> list[Table]:
    keys = (
        ("By fault type", "fault type", tables.by_fault_type),
        ("By scenario", "scenario", tables.by_scenario),
        ("By method", "method", tables.by_method),
    )
    hazards = tables.hazard_names(rows)
    made = []
    for title, head, key in keys:
        counts: tuple[Count, ...] = tables.counts_by(rows, key)
        heads, lines = tables.count_table(counts, head, hazards)
        made.append(Table(title=title, heads=heads, lines=lines))
    return made


def _reading_order(row: Row) -> tuple[str, ...]:
    return (row.module, row.fault_type, row.scenario, row.method, row.trigger, row.experiment_id)


def _line(folder: RunFolder, row: Row) -> Line:
    out = folder.path / FOLDER
    plots, name = folder.path / "plots", row.experiment_id
    return Line(
        row=row,
        patch=_link(folder.patch(name), out),
        plot=_link(plots / f"{name}.svg", out),
        stills=tuple(_stills(plots.glob(f"{name}-*s.jpg"), name, out)),
    )


def _stills(files: Iterable[Path], name: str, seen_from: Path) -> Iterator[tuple[str, str]]:
    """What is shown of each still, and its link; earliest first."""
    for file in sorted(files, key=lambda file: (len(file.name), file.name)):
        if link := _link(file, seen_from):
            yield file.stem.removeprefix(f"{name}-").replace("s", " s"), link


def _link(file: Path, seen_from: Path) -> str | None:
    return Path(os.path.relpath(file, seen_from)).as_posix() if file.exists() else None
