"""The report of a run: REPORT.md, and one HTML page that needs no other file.

Written from results.csv and the run folder, so it can be made again at any time, the same each time; the
published numbers and observations that results stand beside come from the library.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from mutator._common.files import write_atomic
from mutator._common.tables import Table
from mutator.model import Status
from mutator.outcomes import rows as tables
from mutator.outcomes.reader import Results
from mutator.outcomes.rows import Count, Row
from mutator.report import stamp as report_stamp
from mutator.store.run_folder import RunFolder

if TYPE_CHECKING:
    from pandas import DataFrame

    from mutator.figures.figures import Drawing
    from mutator.paper.section import Told
    from mutator.report.browse import Browse
    from mutator.report.engine_section import Told as EngineTold
    from mutator.statistics.sheet import Sheet
    from mutator.workspace import Workspace

FOLDER = "report"
PACKAGES = ("jinja2", "libcst", "numpy")  # what makes mutants and compares runs; run.json has all packages


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """Where a report was written, and of how many experiments it tells."""

    markdown: Path
    page: Path
    rows: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """A table of counts and its title."""

    title: str
    table: Table


@dataclass(frozen=True, slots=True, kw_only=True)
class Content:
    """What both forms of the report say."""

    name: str
    facts: list[tuple[str, str]]
    planned: str  # how many experiments and runs
    outcomes: dict[str, int]
    tables: list[Counts]
    observations: (
        "Told | None"  # of the paper; None: the library has none, or none of their fault types is here
    )
    statistics: "tuple[Sheet, ...]"  # written as files of their own, too
    figures: "tuple[Drawing, ...]"  # written as files that the report shows
    failed: list[Row]  # runs that did not end well, harness errors first
    engine: "EngineTold | None"  # None: nothing was written down of how experiments were run
    browse: "Browse"  # the experiments themselves


def ensure(run: Path, workspace: "Workspace | None") -> Report:
    """The report of a run folder: as it is when nothing that it is made from has changed, else written."""
    folder, out = RunFolder.open(run), run / FOLDER
    markdown, page = _files(out)
    stamp = report_stamp.read(out)
    is_there = markdown.is_file() and page.is_file()
    if is_there and report_stamp.is_of(stamp, out, report_stamp.made_from(folder, workspace)):
        return Report(markdown=markdown, page=page, rows=stamp["rows"])
    return write(run, workspace)


def write(run: Path, workspace: "Workspace | None") -> Report:
    """Write the report of a run folder whose results.csv is up to date.

    What it stands beside comes from the library of `workspace`; without one the results stand alone.
    """
    from mutator.report.page import markdown, page

    folder = RunFolder.open(run)
    out = run / FOLDER
    out.mkdir(exist_ok=True)
    report_stamp.remove(out)
    made_from = report_stamp.made_from(folder, workspace)
    content = _content(folder, out, workspace)
    text, hypertext = _files(out)
    write_atomic(text, markdown(content).encode())
    write_atomic(hypertext, page(content, out).encode())
    rows = sum(content.outcomes.values())
    report_stamp.write(out, made_from, rows)
    return Report(markdown=text, page=hypertext, rows=rows)


def _files(out: Path) -> tuple[Path, Path]:
    return out / "REPORT.md", out / "index.html"


def _content(folder: RunFolder, out: Path, workspace: "Workspace | None") -> Content:
    """What the report says; its tables and figures are written."""
    from mutator.paper import section as report_observations
    from mutator.report import browse as report_browse
    from mutator.report import engine_section as report_engine
    from mutator.statistics import sheets
    from mutator.statistics.frame import load

    rows = Results.of_run(folder.path).rows()
    engine = report_engine.told(folder)
    frame = load(folder.path / "results.csv")
    statistics = sheets.run_sheets(folder, workspace)
    sheets.write(statistics, out)
    done = sum(row.status is not Status.HARNESS_ERROR for row in rows)
    observations = report_observations.told(folder, workspace, frame, done) if workspace else None
    if observations:
        report_observations.write(observations, out)
    failed = [r for r in rows if r.status is not Status.OK]
    return Content(
        name=str(folder.head["campaign"]),
        facts=_facts(folder, rows, engine),
        planned=_planned(folder),
        outcomes=tables.outcome_counts(rows),
        tables=_tables(rows),
        observations=observations,
        statistics=statistics,
        figures=_figures(folder, frame, workspace, whole=bool(observations) and len(rows) == folder.planned),
        failed=sorted(
            failed, key=lambda r: (r.status is not Status.HARNESS_ERROR, r.status, r.experiment_id)
        ),
        engine=engine,
        browse=report_browse.browse(folder, rows, out, workspace),
    )


def _figures(
    folder: RunFolder, frame: "DataFrame", workspace: "Workspace | None", *, whole: bool
) -> "tuple[Drawing, ...]":
    """All figures of the report, written; those of single experiments only of a `whole` run of published
    faults, for experiments may have to be driven again."""
    from mutator.figures import figures
    from mutator.report import examples

    drawings = figures.drawings(frame)
    if whole:
        drawings += examples.drawings(folder, frame, workspace)
    figures.write(drawings, folder.path / FOLDER)
    return drawings


def _planned(folder: RunFolder) -> str:
    """How many experiments and how many runs there are to do, and why these differ."""
    experiments, runs = int(folder.head["experiments"]), folder.head.get("runs")
    told = f"{experiments} experiments are planned"
    if folder.shard:
        told += f", {folder.planned} of them for this shard {folder.shard}"
    if runs is None:  # planned before runs were shared
        return f"{told}."
    if runs == experiments:
        return f"{told}; each is a run of its own."
    return (
        f"{told}; all of them take {runs} runs, for an experiment that is the same run in several scenarios "
        "(without a lead, as one that aims at H2 is driven) is run once and counted in each."
    )


def _facts(folder: RunFolder, rows: Sequence[Row], engine: "EngineTold | None") -> list[tuple[str, str]]:
    """What the results come from, and what they could be made again with."""
    from mutator.review import gate

    reviewed = gate.approval_summary(folder.path)
    head, versions = folder.head, folder.provenance
    facts = {
        "experiments": f"{len(rows)} of {folder.planned} planned",
        **({"proof": engine.state} if engine else {}),
        **({"reviewed": reviewed} if reviewed else {}),
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


def _tables(rows: Sequence[Row]) -> list[Counts]:
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
        made.append(Counts(title=title, table=Table(heads=heads, rows=lines, right=range(1, len(heads)))))
    return made
