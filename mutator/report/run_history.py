"""Writes the history of a folder of runs: the results of each run, and the changes between runs."""

import shlex
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from urllib.parse import quote

from mutator._common.confined_files import path_below
from mutator._common.files import write_atomic
from mutator._common.message_text import counted
from mutator._common.table_rendering import TextTable
from mutator.errors import MutatorError
from mutator.execution.progress_text import describe_duration
from mutator.model import Outcome
from mutator.report.panel import FOLDER, rendered
from mutator.results.result_rows import ResultRow
from mutator.results.table_reader import Results
from mutator.store.run_folder import RunFolder
from mutator.web import asset

FILES = ("HISTORY.md", "history.html")
_HEADS = (
    "run",
    "date (UTC)",
    "commit",
    "experiments",
    "hazards",
    "by severity",
    "silent hazards",
    "CPU time",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PastRun:
    """One run. `date` is the time of its last record, `commit` the commit of its target."""

    folder: RunFolder
    date: datetime
    commit: str
    rows: Mapping[str, ResultRow]
    cpu_s: float

    @property
    def name(self) -> str:
        return self.folder.path.name

    @property
    def hazards(self) -> list[ResultRow]:
        return [row for row in self.rows.values() if row.outcome is Outcome.HAZARD]

    @property
    def activated(self) -> int:
        return sum(row.usable and row.t_activation is not None for row in self.rows.values())


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """The files of a history, its number of runs, and the reasons why run folders were left out."""

    markdown: Path  #: HISTORY.md
    page: Path  #: history.html
    runs: int  #: number of runs in the history
    left_out: tuple[str, ...]  #: for each run folder that is not in the history, the reason


def _run_folders(folder: Path) -> list[Path]:
    return sorted(path for path in folder.glob("*") if RunFolder.exists(path))


def write_history(folder: Path) -> History:
    """Write the history of the runs in a folder. Raise MutatorError if none has results."""
    runs, left_out = [], []
    for path in _run_folders(folder):
        try:
            runs.append(_past_run(path))
        except MutatorError as err:
            left_out.append(f"{path.name}: {err.got}")
    if not runs:
        raise MutatorError(
            f"no run with results ({'; '.join(left_out)})" if left_out else "there is no run folder here",
            where=folder,
            expected="a run folder, or a folder of run folders",
            remedy="check the path",
        )
    runs.sort(key=lambda run: (run.date, run.name))
    text, page = (folder / name for name in FILES)
    write_atomic(text, _markdown(runs, left_out).encode())
    write_atomic(page, _page(folder, runs, left_out).encode())
    return History(markdown=text, page=page, runs=len(runs), left_out=tuple(left_out))


def _past_run(path: Path) -> PastRun:
    folder = RunFolder.open_unverified(path)
    rows = {row.experiment_id: row for row in Results(path).rows()}
    files = [*(path / "records").glob("*.jsonl"), Results(path).path]
    last = max(file.stat().st_mtime for file in files if file.exists())
    git = folder.stretches[-1].git or {}
    state = git.get("target")
    commit = f"{state.commit[:8]}{' with changes' if state.changed else ''}" if state else "-"
    cpu_s = sum(float(line["cpu_s"]) for line in folder.timings().values())
    date = datetime.fromtimestamp(last, UTC)
    return PastRun(folder=folder, date=date, commit=commit, rows=rows, cpu_s=cpu_s)


def _plans(runs: Sequence[PastRun]) -> dict[str, list[PastRun]]:
    """Return the runs by campaign and plan, the plan of the latest run first."""
    found: dict[str, list[PastRun]] = {}
    for run in runs:
        found.setdefault(f"{run.folder.head.campaign}, plan {run.folder.head.plan[:8]}", []).append(run)
    return dict(sorted(found.items(), key=lambda item: item[1][-1].date, reverse=True))


def _cells(run: PastRun) -> list[str]:
    hazards = run.hazards
    classes = Counter(row.severity or "no contact" for row in hazards)
    order = sorted((name for name in classes if name != "no contact"), reverse=True)
    told = ", ".join(f"{name} {classes[name]}" for name in (*order, "no contact") if classes[name])
    silent = sum(row.reaction_time is None for row in hazards)
    return [
        f"{run.date:%Y-%m-%d %H:%M}",
        run.commit,
        f"{len(run.rows)} of {run.folder.planned_count}",
        f"{len(hazards)} of {run.activated} activated",
        told if run.folder.severity_scale and hazards else "-",
        f"{silent} of {len(hazards)}" if run.folder.has_alerts else "-",
        describe_duration(run.cpu_s),
    ]


def _changes(before: PastRun, after: PastRun) -> str:
    shared = before.rows.keys() & after.rows.keys()
    pairs = [(before.rows[name], after.rows[name]) for name in shared]
    new = sum(b.outcome is Outcome.HAZARD is not a.outcome for a, b in pairs)
    gone = sum(a.outcome is Outcome.HAZARD is not b.outcome for a, b in pairs)
    other = sum(a.ending != b.ending for a, b in pairs) - new - gone
    if not new + gone + other:
        return f"{counted(len(shared), 'shared experiment')}, no difference"
    return f"{counted(new, 'new hazard')}, {gone} gone, {other} changed otherwise, of {len(shared):,} shared"


def _steps(runs: Sequence[PastRun]) -> Iterator[tuple[PastRun, PastRun]]:
    """Pairs of consecutive runs of one plan, newest first."""
    return zip(runs[-2::-1], runs[:0:-1], strict=True)


def _command(before: PastRun, after: PastRun) -> str:
    return shlex.join(["mutator", "compare", str(before.folder.path), str(after.folder.path)])


def _markdown(runs: Sequence[PastRun], left_out: Sequence[str]) -> str:
    parts = ["# Runs"]
    for title, group in _plans(runs).items():
        rows = [[run.name, *_cells(run)] for run in reversed(group)]
        parts += [f"## {title}", TextTable(heads=_HEADS, rows=rows).as_markdown()]
        parts += [f"{a.name} to {b.name}: {_changes(a, b)}. `{_command(a, b)}`" for a, b in _steps(group)]
    if left_out:
        parts += ["## Left out", *(f"* {why}" for why in left_out)]
    return "\n\n".join(parts) + "\n"


def _page(folder: Path, runs: Sequence[PastRun], left_out: Sequence[str]) -> str:
    from markupsafe import Markup

    plans = [
        (title, _linked(group), [(a, b, _changes(a, b), _comparison(folder, a, b)) for a, b in _steps(group)])
        for title, group in _plans(runs).items()
    ]
    styles = [Markup(asset(name)) for name in ("shared/base.css", "report/report.css")]
    page = rendered(
        asset("report/history.html"),
        name=folder.resolve().name,
        count=counted(len(runs), "run"),
        plans=plans,
        left_out=left_out,
        styles=styles,
        command=_command,
    )
    return str(page)


def _linked(group: Sequence[PastRun]) -> TextTable:
    """Return the table of runs, newest first, with links to their reports."""
    from markupsafe import Markup

    link = Markup('<a href="{}">{}</a>').format
    bar = Markup('<span class="meter" style="--share: {:.3f}"></span>{}').format
    rows = []
    for run in reversed(group):
        report = run.folder.path / FOLDER / "index.html"
        name = link(f"{quote(run.name)}/{FOLDER}/index.html", run.name) if report.exists() else run.name
        cells = _cells(run)
        cells[3] = bar(len(run.hazards) / run.activated if run.activated else 0.0, cells[3])
        rows.append([name, *cells])
    return TextTable(heads=_HEADS, rows=rows)


def _comparison(folder: Path, before: PastRun, after: PastRun) -> str:
    """Return the path of an existing comparison page, relative to the folder; '' if there is none."""
    page = Path(after.name, FOLDER, f"compare-{before.name}", "index.html")
    return quote(page.as_posix()) if path_below(folder, page.as_posix()).exists() else ""
