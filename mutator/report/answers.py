"""Answers to a reader's first questions. Each answer links to its experiments in the list."""

from typing import Any

import pandas as pd

from mutator._common.message_text import counted
from mutator.engines.engine_jobs import RunMode
from mutator.execution.progress_text import describe_duration
from mutator.report.answer_parts import (
    FIRST,
    LATE,
    NO_ALERT,
    SILENT,
    Answer,
    Link,
    Listing,
    Part,
    bar,
    by_kind,
    kind_link,
    share,
    to_list,
    warnings_of,
    were,
)
from mutator.report.experiment_facts import PLACE, UNTIMED_PATH
from mutator.report.fix_order import first_to_fix
from mutator.report.most_dangerous import dangerous, worst_of
from mutator.report.reported_run import ReportedRun
from mutator.results.result_rows import ResultRow, rows_of

TYPES = 6  # maximum number of fault types that an answer lists


def answers_of(run: ReportedRun) -> tuple[Answer, ...]:
    """All answers for which the run has the data."""
    frame = _told(run)
    has_alerts = run.folder.has_alerts
    made = [dangerous(frame, run.folder.head.metrics, has_alerts=has_alerts)]
    if (frame["outcome"] == "hazard").any():
        made.append(first_to_fix(frame, run.paths, has_alerts=has_alerts))
    if has_alerts:
        made.append(unwarned(frame, run.folder.stop_note))
    made.append(survived(frame))
    if len(run.seen.timings):
        made.append(time_spent(frame, run.seen.timings))
    return tuple(made)


def _told(run: ReportedRun) -> pd.DataFrame:
    """Return the usable experiments with rank, path and warning. Those that answers can list also have
    words.
    """
    frame = run.frame
    told = frame.assign(place=frame[PLACE], untimed_path=frame[UNTIMED_PATH], warning=warnings_of(frame))
    shown = worst_of(told)
    rows = rows_of(run.results[run.results["experiment_id"].isin(shown)], run.faults)
    words: dict[str, dict[str, Any]] = {
        "fault": {row.experiment_id: row.fault for row in rows},
        "hazard_names": {row.experiment_id: tuple(name for name, _ in row.hazards) for row in rows},
        "margins": {row.experiment_id: row.margins for row in rows},
        "warned": {row.experiment_id: _warned(row) for row in rows},
    }
    return told.assign(**{name: told["experiment_id"].map(word) for name, word in words.items()})


def _warned(row: ResultRow) -> str:
    """Return the first alert and its time before the hazard; `only after` if it came later; `none` without
    one.
    """
    if row.reaction_time is None:
        return "only after" if row.alerts else "none"
    return f"{row.alerts[0]}, {row.reaction_time:.1f} s"


def unwarned(frame: pd.DataFrame, note: str = "") -> Answer:
    """Say which hazards were silent. `note` is a caveat about alerts that were not observed."""
    hazards = frame[frame["outcome"] == "hazard"]
    silent = hazards[hazards["warning"] != FIRST]
    never, late = (int((silent["warning"] == name).sum()) for name in (NO_ALERT, LATE))
    says = f"{share(len(silent), len(hazards), 'hazards')} {were(len(silent))} silent (no alert "
    says += "before the hazard)"
    says += (
        f": {never:,} with no alert at all, {late:,} with an alert only after the hazard."
        if never or late
        else "."
    )
    says += f" {note}" if note else ""
    kinds = by_kind(silent, hazards)
    lines = [
        (
            kind_link(kind, warning=SILENT),
            bar(part, of),
            f"{int(((silent['kind'] == kind) & (silent['warning'] == NO_ALERT)).sum()):,}",
        )
        for kind, part, of in kinds[:TYPES]
        if part
    ]
    heads = ("fault type, most silent hazards first", "silent / hazards", "no alert at all")
    links = {"Silent hazards": SILENT, "No alert at all": [NO_ALERT], "Only after the hazard": [LATE]}
    return Answer(
        name="unwarned",
        title="Which hazards were silent",
        says="No hazard occurred."
        if hazards.empty
        else says + _more(sum(part > 0 for _, part, _ in kinds), "fault types with silent hazards"),
        listings=(Listing(heads=heads, lines=lines),),
        links=tuple(
            Link(text, to_list({"warning": values}))
            for text, values in links.items()
            if silent["warning"].isin(values).any()
        ),
    )


def _more(count: int, what: str) -> str:
    """Return a note that a list is truncated, or '' if it is complete."""
    return f" The table shows {TYPES} of the {count:,} {what}." if count > TYPES else ""


def survived(frame: pd.DataFrame) -> Answer:
    """Say how many activated faults led to no hazard, and which fault types never led to one."""
    active = frame[frame["is_activated"]]
    fine = active[active["outcome"].isin(["masked", "sdc"])]
    moved = int(fine["is_manifested"].sum())
    broken = len(active) - len(fine) - int((active["outcome"] == "hazard").sum())
    says = f"{share(len(fine), len(active), 'activated faults')} led to no hazard: "
    says += f"{len(fine) - moved:,} changed no actuator (masked), {moved:,} did (sdc)."
    says += f" {broken:,} crashed or timed out." if broken else ""
    kinds = by_kind(fine, active)
    whole = [(kind, of) for kind, part, of in kinds if part == of]
    says += f" {share(len(whole), len(kinds), 'fault types')} never led to a hazard"
    says += ", a crash or a timeout." if broken else "."
    weak = sorted((k for k in kinds if k[1] < k[2]), key=lambda k: (k[1] / k[2], -k[2], k[0]))
    says += _more(len(weak), "fault types that led to one")
    ends = {"outcome": ["masked", "sdc"]}
    least = [(kind_link(kind, **ends), bar(part, of)) for kind, part, of in weak[:TYPES]]
    never = [(kind_link(kind, **ends), f"{of:,}") for kind, of in whole]
    return Answer(
        name="survived",
        title="What the controller tolerated",
        says="No fault was activated." if active.empty else says,
        listings=(
            Listing(heads=("fault type, lowest share first", "no hazard / activated"), lines=least),
            Listing(heads=("never led to a hazard", "activated"), lines=never),
        ),
        links=tuple(
            Link(text, to_list({"outcome": [outcome]}))
            for text, outcome in (("Masked", "masked"), ("Changed an actuator, no hazard", "sdc"))
            if (fine["outcome"] == outcome).any()
        ),
    )


def time_spent(frame: pd.DataFrame, timings: pd.DataFrame) -> Answer:
    """Say how much CPU time the experiments took, and why some took none."""
    cpu = frame["experiment_id"].map(timings.set_index("experiment_id")["cpu_s"]).astype(float)
    total, ran = float(cpu.sum()), int((cpu > 0).sum())
    workers = timings["worker"].nunique()
    says = f"The experiments took {describe_duration(total)} of CPU time on {counted(workers, 'worker')}: "
    says += f"{share(ran, len(frame), 'experiments')} {were(ran)} simulated{_undriven(frame, cpu, timings)}."
    if ran:
        says += f" Median {cpu[cpu > 0].median():.2f} s, longest {cpu.max():.2f} s."
    says += " Checks, golden runs and the equivalence check are not timed."
    costs = cpu.groupby(frame["kind"]).sum().sort_values(ascending=False, kind="stable")
    lines = [
        (
            kind_link(str(kind)),
            Part(float(s), total, f"{describe_duration(float(s))} ({100 * s / total:.0f} %)"),
        )
        for kind, s in costs.head(TYPES).items()
        if s > 0
    ]
    return Answer(
        name="time",
        title="Where the time went",
        says=says + _more(int((costs > 0).sum()), "fault types"),
        listings=(Listing(heads=("fault type, most time first", "CPU time"), lines=lines),),
    )


def _undriven(frame: pd.DataFrame, cpu: pd.Series, timings: pd.DataFrame) -> str:
    rest = frame["experiment_id"][~(cpu > 0)]
    golden = timings[timings["engine"] == RunMode.GOLDEN.value]
    idle = int(rest.isin(golden["experiment_id"]).sum())
    why = {
        "the trigger never held, so the golden run's result was used": idle,
        "the result of an experiment with an identical run was used": len(rest) - idle,
    }
    return "".join(f"; for {count:,}, {words}" for words, count in why.items() if count)
