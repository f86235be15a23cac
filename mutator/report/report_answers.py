"""Answers to a reader's first questions. Each answer links to its experiments in the list."""

from functools import partial
from typing import TYPE_CHECKING, Any

from mutator._common.message_text import counted, rounded_percent
from mutator.engines.engine_jobs import RunMode
from mutator.execution.progress_text import describe_duration
from mutator.report.answer_parts import (
    ALERT_AFTER_HAZARD,
    ALERT_BEFORE_HAZARD,
    NO_ALERT,
    SILENT_HAZARD_WARNINGS,
    AnswerTable,
    PageLink,
    ReportAnswer,
    ShareBar,
    describe_share,
    fault_type_counts,
    fault_type_link,
    filtered_list_fragment,
    share_bar,
    warning_filter_values,
    was_or_were,
)
from mutator.report.experiment_facts import RANK_COLUMN, UNTIMED_PATH_COLUMN
from mutator.report.fix_first_answers import fix_first_answer
from mutator.report.most_dangerous_experiments_answer import most_dangerous_answer, worst_hazard_ids
from mutator.report.reported_run import ReportedRun
from mutator.results.experiment_sentence import ExperimentSentences
from mutator.results.result_rows import ResultRow, rows_of
from mutator.statistics.sample_weights import WEIGHT_COLUMN

if TYPE_CHECKING:
    import pandas as pd

MOST_FAULT_TYPES = 6  # maximum number of fault types that an answer lists


def build_answers(run: ReportedRun) -> tuple[ReportAnswer, ...]:
    """All answers for which the run has the data."""
    frame = _frame_for_answers(run)
    has_alerts = run.folder.has_alerts
    scale = run.folder.severity_scale
    labels = scale.labels if scale else {}
    answers = [most_dangerous_answer(frame, run.folder.head.metrics, labels, has_alerts=has_alerts)]
    if (frame["outcome"] == "hazard").any():
        answers.append(fix_first_answer(frame, run.run_fault_paths, labels, has_alerts=has_alerts))
    if has_alerts:
        answers.append(silent_hazards_answer(frame, run.folder.early_end_note))
    answers.append(tolerated_faults_answer(frame))
    if len(run.experiment_facts.timings):
        answers.append(time_spent_answer(frame, run.experiment_facts.timings))
    return tuple(answers)


def _frame_for_answers(run: ReportedRun) -> "pd.DataFrame":
    """Return the usable experiments with rank, path and warning. Those that answers can list also have
    words.
    """
    frame = run.frame
    extended = frame.assign(
        place=frame[RANK_COLUMN],
        untimed_path=frame[UNTIMED_PATH_COLUMN],
        warning=warning_filter_values(frame),
    )
    listed_ids = worst_hazard_ids(extended)
    sentences = ExperimentSentences.of_run(run.folder.head)
    rows = rows_of(run.results[run.results["experiment_id"].isin(listed_ids)], run.faults, sentences)
    listed_columns: dict[str, dict[str, Any]] = {
        "fault": {row.experiment_id: row.fault for row in rows},
        "sentence": {row.experiment_id: row.sentence for row in rows},
        "scenario_label": {row.experiment_id: row.scenario_label for row in rows},
        "hazard_names": {row.experiment_id: tuple(name for name, _ in row.hazards) for row in rows},
        "margins": {row.experiment_id: row.margins for row in rows},
        "warned": {row.experiment_id: _describe_first_alert(row) for row in rows},
    }
    return extended.assign(
        **{name: extended["experiment_id"].map(word) for name, word in listed_columns.items()}
    )


def _describe_first_alert(row: ResultRow) -> str:
    """Return the first alert and its time before the hazard; `only after` if it came later; `none` without
    one.
    """
    if row.reaction_time is None:
        return "only after" if row.alerts else "none"
    return f"{row.alerts[0]}, {row.reaction_time:.1f} s"


def silent_hazards_answer(frame: "pd.DataFrame", alerts_caveat: str = "") -> ReportAnswer:
    """Say which hazards were silent. `alerts_caveat` is about alerts that were not observed."""
    hazards = frame[frame["outcome"] == "hazard"]
    share_text = partial(describe_share, is_sample=WEIGHT_COLUMN in frame)
    silent = hazards[hazards["warning"] != ALERT_BEFORE_HAZARD]
    never, late = (int((silent["warning"] == name).sum()) for name in (NO_ALERT, ALERT_AFTER_HAZARD))
    paragraph = (
        f"{share_text(len(silent), len(hazards), 'hazards')} {was_or_were(len(silent))} silent (no alert "
    )
    paragraph += "before the hazard)"
    paragraph += (
        f": {never:,} with no alert at all, {late:,} with an alert only after the hazard."
        if never or late
        else "."
    )
    paragraph += f" {alerts_caveat}" if alerts_caveat else ""
    kinds = fault_type_counts(silent, hazards)
    rows = [
        (
            fault_type_link(kind, warning=SILENT_HAZARD_WARNINGS),
            share_bar(part, of),
            f"{int(((silent['kind'] == kind) & (silent['warning'] == NO_ALERT)).sum()):,}",
        )
        for kind, part, of in kinds[:MOST_FAULT_TYPES]
        if part
    ]
    heads = ("fault type, most silent hazards first", "silent / hazards", "no alert at all")
    links = {
        "Silent hazards": SILENT_HAZARD_WARNINGS,
        "No alert at all": [NO_ALERT],
        "Only after the hazard": [ALERT_AFTER_HAZARD],
    }
    return ReportAnswer(
        html_name="unwarned",
        title="Which hazards were silent",
        paragraph="No hazard occurred."
        if hazards.empty
        else paragraph
        + _describe_truncation(sum(part > 0 for _, part, _ in kinds), "fault types with silent hazards"),
        tables=(AnswerTable(heads=heads, rows=rows),),
        links=tuple(
            PageLink(text, filtered_list_fragment({"warning": values}))
            for text, values in links.items()
            if silent["warning"].isin(values).any()
        ),
    )


def _describe_truncation(count: int, plural_noun: str) -> str:
    """Return a note that a list is truncated, or '' if it is complete."""
    return (
        f" The table shows {MOST_FAULT_TYPES} of the {count:,} {plural_noun}."
        if count > MOST_FAULT_TYPES
        else ""
    )


def tolerated_faults_answer(frame: "pd.DataFrame") -> ReportAnswer:
    """Say how many activated faults led to no hazard, and which fault types never led to one."""
    active = frame[frame["is_activated"]]
    share_text = partial(describe_share, is_sample=WEIGHT_COLUMN in frame)
    without_hazard = active[active["outcome"].isin(["masked", "sdc"])]
    actuator_changes = int(without_hazard["is_manifested"].sum())
    unfinished = len(active) - len(without_hazard) - int((active["outcome"] == "hazard").sum())
    paragraph = f"{share_text(len(without_hazard), len(active), 'activated faults')} led to no hazard: "
    masked = len(without_hazard) - actuator_changes
    paragraph += f"{masked:,} changed no actuator (masked), {actuator_changes:,} did (sdc)."
    paragraph += f" {unfinished:,} crashed or timed out." if unfinished else ""
    kinds = fault_type_counts(without_hazard, active)
    whole = [(kind, of) for kind, part, of in kinds if part == of]
    paragraph += f" {describe_share(len(whole), len(kinds), 'fault types')} never led to a hazard"
    paragraph += ", a crash or a timeout." if unfinished else "."
    weak = sorted((k for k in kinds if k[1] < k[2]), key=lambda k: (k[1] / k[2], -k[2], k[0]))
    paragraph += _describe_truncation(len(weak), "fault types that led to one")
    ends = {"outcome": ["masked", "sdc"]}
    least = [
        (fault_type_link(kind, **ends), share_bar(part, of)) for kind, part, of in weak[:MOST_FAULT_TYPES]
    ]
    never = [(fault_type_link(kind, **ends), f"{of:,}") for kind, of in whole]
    return ReportAnswer(
        html_name="survived",
        title="What the controller tolerated",
        paragraph="No fault was activated." if active.empty else paragraph,
        tables=(
            AnswerTable(heads=("fault type, lowest share first", "no hazard / activated"), rows=least),
            AnswerTable(heads=("never led to a hazard", "activated"), rows=never),
        ),
        links=tuple(
            PageLink(text, filtered_list_fragment({"outcome": [outcome]}))
            for text, outcome in (("Masked", "masked"), ("Changed an actuator, no hazard", "sdc"))
            if (without_hazard["outcome"] == outcome).any()
        ),
    )


def time_spent_answer(frame: "pd.DataFrame", timings: "pd.DataFrame") -> ReportAnswer:
    """Say how much CPU time the experiments took, and why some took none."""
    cpu = frame["experiment_id"].map(timings.set_index("experiment_id")["cpu_s"]).astype(float)
    total, ran = float(cpu.sum()), int((cpu > 0).sum())
    workers = timings["worker"].nunique()
    paragraph = (
        f"The experiments took {describe_duration(total)} of CPU time on {counted(workers, 'worker')}: "
    )
    paragraph += f"{describe_share(ran, len(frame), 'experiments')} {was_or_were(ran)} simulated"
    paragraph += f"{_describe_unsimulated(frame, cpu, timings)}."
    if ran:
        paragraph += f" Median {cpu[cpu > 0].median():.2f} s, longest {cpu.max():.2f} s."
    paragraph += " Checks, golden runs and the equivalence check are not timed."
    costs = cpu.groupby(frame["kind"]).sum().sort_values(ascending=False, kind="stable")
    rows = [
        (
            fault_type_link(str(kind)),
            ShareBar(
                float(s), total, f"{describe_duration(float(s))} ({rounded_percent(float(s), total)} %)"
            ),
        )
        for kind, s in costs.head(MOST_FAULT_TYPES).items()
        if s > 0
    ]
    return ReportAnswer(
        html_name="time",
        title="Where the time went",
        paragraph=paragraph + _describe_truncation(int((costs > 0).sum()), "fault types"),
        tables=(AnswerTable(heads=("fault type, most time first", "CPU time"), rows=rows),),
    )


def _describe_unsimulated(frame: "pd.DataFrame", cpu: "pd.Series", timings: "pd.DataFrame") -> str:
    rest = frame["experiment_id"][~(cpu > 0)]
    golden = timings[timings["engine"] == RunMode.GOLDEN_REUSED.value]
    idle = int(rest.isin(golden["experiment_id"]).sum())
    reused = timings[timings["engine"] == RunMode.REUSED.value]
    copied = int(rest.isin(reused["experiment_id"]).sum())
    unaffected = timings[timings["engine"] == RunMode.UNAFFECTED.value]
    left_out = int(rest.isin(unaffected["experiment_id"]).sum())
    reasons = {
        "the result of an earlier run with the same experiment was copied": copied,
        "nothing that an earlier run executed had changed, so its result stands": left_out,
        "the trigger never held, so the golden run's result was used": idle,
        "the result of an experiment with an identical run was used": len(rest) - idle - copied - left_out,
    }
    return "".join(f"; for {count:,}, {words}" for words, count in reasons.items() if count)
