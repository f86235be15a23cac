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
from mutator.report.panel import REPORT_FOLDER, rendered
from mutator.results.result_rows import ResultRow
from mutator.results.table_reader import Results
from mutator.store.run_folder import RunFolder
from mutator.store.timings import ending_of
from mutator.web import asset_text

HISTORY_FILES = ("HISTORY.md", "history.html")
_COLUMN_HEADS = (
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
    """One run. `date` is the time of its last record; None if an older version wrote it without times."""

    folder: RunFolder
    date: datetime | None
    target_commit: str
    rows_by_id: Mapping[str, ResultRow]
    cpu_s: float

    @property
    def name(self) -> str:
        return self.folder.path.name

    @property
    def hazards(self) -> list[ResultRow]:
        return [row for row in self.rows_by_id.values() if row.outcome is Outcome.HAZARD]

    @property
    def activated_count(self) -> int:
        return sum(row.usable and row.t_activation is not None for row in self.rows_by_id.values())


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """The files of a history, its number of runs, and the reasons why run folders were left out."""

    markdown: Path  #: HISTORY.md
    page: Path  #: history.html
    runs: int  #: number of runs in the history
    left_out: tuple[str, ...]  #: for each run folder that is not in the history, the reason


def run_folders(folder: Path) -> list[Path]:
    return sorted(path for path in folder.glob("*") if RunFolder.exists(path))


def write_history(folder: Path) -> History:
    """Write the history of the runs in a folder. Raise MutatorError if none has results."""
    runs, omission_reasons = [], []
    for path in run_folders(folder):
        try:
            runs.append(_past_run(path))
        except MutatorError as err:
            omission_reasons.append(f"{path.name}: {err.got}")
    if not runs:
        raise MutatorError(
            f"no run with results ({'; '.join(omission_reasons)})"
            if omission_reasons
            else "there is no run folder here",
            where=folder,
            expected="a run folder, or a folder of run folders",
            remedy="check the path",
        )
    runs.sort(key=_sort_key_by_date)
    text, page = (folder / name for name in HISTORY_FILES)
    write_atomic(text, _history_markdown(runs, omission_reasons).encode())
    write_atomic(page, _history_html(folder, runs, omission_reasons).encode())
    return History(markdown=text, page=page, runs=len(runs), left_out=tuple(omission_reasons))


def _past_run(path: Path) -> PastRun:
    folder = RunFolder.open_unverified(path)
    rows = {row.experiment_id: row for row in Results(path).rows()}
    cpu_s = sum(float(line["cpu_s"]) for line in folder.timings().values())
    return PastRun(
        folder=folder,
        date=end_of_last_experiment(folder),
        target_commit=target_commit_of(folder),
        rows_by_id=rows,
        cpu_s=cpu_s,
    )


def target_commit_of(folder: RunFolder) -> str:
    """Return the commit of the target in the last session, or `-` if none is known."""
    sessions = folder.session_environments  # none: nothing has run yet
    state = (sessions[-1].git or {}).get("target") if sessions else None
    return f"{state.commit[:8]}{' with changes' if state.changed else ''}" if state else "-"


def end_of_last_experiment(folder: RunFolder) -> datetime | None:
    """Return when the last experiment of a run ended; None if the run has no times."""
    endings = filter(None, map(ending_of, folder.timings().values()))
    return max(endings, default=None)


def _sort_key_by_date(run: PastRun) -> tuple[datetime, str]:
    return run.date or datetime.min.replace(tzinfo=UTC), run.name


def _group_by_plan(runs: Sequence[PastRun]) -> dict[str, list[PastRun]]:
    """Return the runs by campaign and plan, the plan of the latest run first."""
    runs_by_plan: dict[str, list[PastRun]] = {}
    for run in runs:
        runs_by_plan.setdefault(f"{run.folder.head.campaign}, plan {run.folder.head.plan[:8]}", []).append(
            run
        )
    return dict(sorted(runs_by_plan.items(), key=lambda item: _sort_key_by_date(item[1][-1]), reverse=True))


def _table_cells(run: PastRun) -> list[str]:
    hazards = run.hazards
    classes = Counter(row.severity or "no class" for row in hazards)
    order = sorted((name for name in classes if name != "no class"), reverse=True)
    scale = run.folder.severity_scale
    labels = scale.labels if scale else {}
    severity_text = ", ".join(
        f"{labels.get(name, name)}: {classes[name]}" for name in (*order, "no class") if classes[name]
    )
    silent = sum(row.reaction_time is None for row in hazards)
    return [
        f"{run.date:%Y-%m-%d %H:%M}" if run.date else "-",
        run.target_commit,
        f"{len(run.rows_by_id)} of {run.folder.planned_experiment_count}",
        f"{len(hazards)} of {run.activated_count} activated",
        severity_text if scale and hazards else "-",
        f"{silent} of {len(hazards)}" if run.folder.has_alerts else "-",
        describe_duration(run.cpu_s),
    ]


def _describe_changes(before: PastRun, after: PastRun) -> str:
    shared = before.rows_by_id.keys() & after.rows_by_id.keys()
    pairs = [(before.rows_by_id[name], after.rows_by_id[name]) for name in shared]
    new_hazards = sum(b.outcome is Outcome.HAZARD is not a.outcome for a, b in pairs)
    resolved = sum(a.outcome is Outcome.HAZARD is not b.outcome for a, b in pairs)
    other = sum(a.ending != b.ending for a, b in pairs) - new_hazards - resolved
    if not new_hazards + resolved + other:
        return f"{counted(len(shared), 'shared experiment')}, no difference"
    changes = f"{counted(new_hazards, 'new hazard')}, {resolved} gone, {other} changed otherwise"
    return f"{changes}, of {len(shared):,} shared"


def _consecutive_runs(runs: Sequence[PastRun]) -> Iterator[tuple[PastRun, PastRun]]:
    """Pairs of consecutive runs of one plan, newest first."""
    return zip(runs[-2::-1], runs[:0:-1], strict=True)


def _compare_command(before: PastRun, after: PastRun) -> str:
    return shlex.join(["mutator", "compare", str(before.folder.path), str(after.folder.path)])


def _history_markdown(runs: Sequence[PastRun], omission_reasons: Sequence[str]) -> str:
    parts = ["# Runs"]
    for title, group in _group_by_plan(runs).items():
        rows = [[run.name, *_table_cells(run)] for run in reversed(group)]
        parts += [f"## {title}", TextTable(heads=_COLUMN_HEADS, rows=rows).as_markdown()]
        parts += [
            f"{a.name} to {b.name}: {_describe_changes(a, b)}. `{_compare_command(a, b)}`"
            for a, b in _consecutive_runs(group)
        ]
    if omission_reasons:
        parts += ["## Left out", *(f"* {why}" for why in omission_reasons)]
    return "\n\n".join(parts) + "\n"


def _history_html(folder: Path, runs: Sequence[PastRun], omission_reasons: Sequence[str]) -> str:
    from markupsafe import Markup

    plans = [
        (
            title,
            _linked_table(group),
            [
                (a, b, _describe_changes(a, b), _comparison_link(folder, a, b))
                for a, b in _consecutive_runs(group)
            ],
        )
        for title, group in _group_by_plan(runs).items()
    ]
    styles = [Markup(asset_text(name)) for name in ("shared/base.css", "report/report.css")]
    page = rendered(
        asset_text("report/history.html"),
        name=folder.resolve().name,
        count=counted(len(runs), "run"),
        plans=plans,
        left_out=omission_reasons,
        styles=styles,
        command=_compare_command,
    )
    return str(page)


def _linked_table(group: Sequence[PastRun]) -> TextTable:
    """Return the table of runs, newest first, with links to their reports."""
    from markupsafe import Markup

    link = Markup('<a href="{}">{}</a>').format
    bar = Markup('<span class="meter" style="--share: {:.3f}"></span>{}').format
    rows = []
    for run in reversed(group):
        report = run.folder.path / REPORT_FOLDER / "index.html"
        name = (
            link(f"{quote(run.name)}/{REPORT_FOLDER}/index.html", run.name) if report.exists() else run.name
        )
        cells = _table_cells(run)
        cells[3] = bar(len(run.hazards) / run.activated_count if run.activated_count else 0.0, cells[3])
        rows.append([name, *cells])
    return TextTable(heads=_COLUMN_HEADS, rows=rows)


def _comparison_link(folder: Path, before: PastRun, after: PastRun) -> str:
    """Return the path of an existing comparison page, relative to the folder; '' if there is none."""
    page = Path(after.name, REPORT_FOLDER, f"compare-{before.name}", "index.html")
    return quote(page.as_posix()) if path_below(folder, page.as_posix()).exists() else ""
