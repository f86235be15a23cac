"""The first answers of a report, compared with counts by hand."""

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pandas as pd
import pytest

from mutator.outcomes.fault_paths import LinkState, PathLink, UntimedPath
from mutator.report.answer_parts import (
    NO_ALERT,
    ExplainedCodes,
    PageLink,
    ReportAnswer,
    ShareBar,
    filtered_list_fragment,
)
from mutator.report.fault_path_page_data import RunFaultPaths
from mutator.report.fix_first_answers import fix_first_answer
from mutator.report.most_dangerous_experiments_answer import most_dangerous_answer
from mutator.report.panels.answers_panel import build_answers_panel
from mutator.report.report_answers import build_answers
from mutator.report.reported_run import ReportedRun
from mutator.results.severity_and_sentence_columns import TIME_TO_HAZARD_COLUMNS
from mutator.results.table_columns import result_columns
from mutator.store.checksummed_lines import line_file_bytes
from mutator.store.run_folder import RunFolder
from mutator.store.timings import TIMINGS_SCHEMA
from mutator.targets.stored_target_facts import MetricFacts
from tests.made_up_results import write_results

from .made_run import HEAD, make_run

METRICS = [
    MetricFacts("margin_h1", "m", "how far it stayed from H1", "lower"),
    MetricFacts("contact_speed", "m/s", "closing speed at contact", "higher"),
]
#  kind, outcome, t_activation, t_h1, alerts, t_alert, contact_speed, margin
RUNS = [
    ("radar/chaff", "hazard", 2, 5, "", "", 4, -1),
    ("radar/chaff", "hazard", 2, 6, "fcw", 5, 9, -2),
    ("radar/chaff", "sdc", 2, "", "", "", "", 3),
    ("car/speed", "hazard", 2, 7, "fcw", 8, "", -0.25),
    ("car/speed", "hazard", 2, 9, "", "", "", -0.5),
    ("car/speed", "masked", 2, "", "", "", "", 3),
    ("car/steer", "masked", 2, "", "", "", "", 3),
    ("car/steer", "not_activated", "", "", "", "", "", 3),
]


@pytest.fixture
def run(tmp_path: Path) -> ReportedRun:
    make_run(tmp_path, hazards=["H1"], compared=["gas"], metrics=METRICS)
    lines = []
    for i, (kind, outcome, active, hazard, alerts, alert, speed, margin) in enumerate(RUNS):
        module, fault_type = kind.split("/")
        line = {"module": module, "fault_type": fault_type, "outcome": outcome, "status": "ok"}
        line |= {"t_activation": active, "h1": int(hazard != ""), "t_h1": hazard, "alerts": alerts}
        line |= {"t_alert": alert, "contact_speed": speed, "margin_h1": margin, "scenario": "S1"}
        line |= {"experiment_id": f"{i}" * 16, "fault_id": f"f{i}", "method": "guided", "trigger": "C1"}
        line |= {"seed": 1, "t_manifest": 2.5 if outcome in ("hazard", "sdc") else "", "variant": "x"}
        line |= {"reaction_time": hazard - alert if alerts and alert < hazard else ""}
        lines.append(line)
    write_results(tmp_path, result_columns(("H1",), ("gas",), METRICS, TIME_TO_HAZARD_COLUMNS), lines)
    costs = [
        {"experiment_id": f"{i}" * 16, "cpu_s": 2.0**i, "wall_s": 1.0, "host": "h", "worker": f"w{i % 2}"}
        | {"engine": "fork", "why": ""}
        for i in range(7)
    ]
    costs.append(costs[0] | {"experiment_id": "7" * 16, "cpu_s": 0, "engine": "golden"})
    path = tmp_path / "timings" / "0001-main.jsonl"
    path.parent.mkdir()
    path.write_bytes(line_file_bytes(path, {"schema": TIMINGS_SCHEMA, "plan": HEAD["plan"]}, costs))
    return ReportedRun.open(RunFolder.open(tmp_path), None)


@pytest.fixture
def answer_by_name(run: ReportedRun) -> dict[str, ReportAnswer]:
    return {answer.html_name: answer for answer in build_answers(run)}


def test_the_worst_experiment_is_first(answer_by_name: dict[str, ReportAnswer]) -> None:
    """Silent hazards precede hazards after an alert, also if those have the lower margin."""
    answer = answer_by_name["dangerous"]
    assert (
        answer.paragraph
        == "4 of 7 activated faults (57 %) led to a hazard. 2 of 4 hazards (50 %) involved contact."
    )
    worst, kinds = answer.tables
    assert [line[0] for line in worst.rows] == [
        PageLink("radar/chaff/x", f"e={'0' * 16}&outcome=hazard&sort=rank", "in S1, trigger C1"),
        PageLink("car/speed/x", f"e={'4' * 16}&outcome=hazard&sort=rank", "in S1, trigger C1"),
    ]
    assert worst.heads[2:] == ("measure", "time to hazard", "alert before hazard", "more of this cause")
    assert [line[2:-1] for line in worst.rows] == [
        ("contact at 4.00 m/s", "3.00 s", "none"),
        ("margin -0.50 m", "7.00 s", "none"),
    ]
    assert worst.rows[0][-1] == PageLink("1", "kind=radar%2Fchaff&outcome=hazard&hazards=H1&sort=rank")
    assert [line[1] for line in kinds.rows] == [ShareBar(2, 3, "2 of 3"), ShareBar(2, 3, "2 of 3")]
    assert answer.links == (PageLink("All 4 hazards", "outcome=hazard&sort=rank"),)


def test_an_alert_after_the_hazard_is_not_a_warning(answer_by_name: dict[str, ReportAnswer]) -> None:
    answer = answer_by_name["unwarned"]
    assert answer.paragraph == (
        "3 of 4 hazards (75 %) were silent (no alert before the hazard): 2 with no alert at all, 1 with an "
        "alert only after the hazard."
    )
    assert [line[2] for line in answer.tables[0].rows] == ["1", "1"]
    assert [line[1] for line in answer.tables[0].rows] == [ShareBar(2, 2, "2 of 2"), ShareBar(1, 2, "1 of 2")]
    assert [link.fragment for link in answer.links] == [
        "warning=no%20alert%20at%20all,alert%20only%20after%20the%20hazard",
        "warning=no%20alert%20at%20all",
        "warning=alert%20only%20after%20the%20hazard",
    ]


def test_without_severity_the_number_of_silent_hazards_decides(
    answer_by_name: dict[str, ReportAnswer],
) -> None:
    answer = answer_by_name["first"]
    assert answer.paragraph.startswith("Start with car/speed: 2 of 3 silent hazards (67 %). The rule: ")
    silent = "warning=no%20alert%20at%20all,alert%20only%20after%20the%20hazard"
    assert [line[:3] for line in answer.tables[0].rows] == [
        (
            PageLink("car/speed", f"kind=car%2Fspeed&{silent}"),
            PageLink("2", f"kind=car%2Fspeed&{silent}&sort=rank"),
            PageLink("5.00 s", f"e={'3' * 16}&kind=car%2Fspeed&{silent}&sort=rank"),
        ),
        (
            PageLink("radar/chaff", f"kind=radar%2Fchaff&{silent}"),
            PageLink("1", f"kind=radar%2Fchaff&{silent}&sort=rank"),
            PageLink("3.00 s", f"e={'0' * 16}&kind=radar%2Fchaff&{silent}&sort=rank"),
        ),
    ]


def hazards(*rows: tuple[str, str, float]) -> pd.DataFrame:
    names = ["kind", "severity", "after"]
    frame = pd.DataFrame(rows, columns=names)
    frame["t_hazard"] = 2 + frame["after"]
    frame["experiment_id"] = [f"e{i}" for i in frame.index]
    same = {"outcome": "hazard", "is_activated": True, "t_activation": 2.0, "warning": NO_ALERT}
    told = {"scenario": "S1", "trigger": "C1", "sentence": "", "warned": "none", "delta_v": math.nan}
    for name, cell in {"hazard_names": ("H1", "H2"), "margins": (("H1", -1.0), ("H2", -2.0))}.items():
        told[name] = [cell] * len(frame)
    return frame.assign(fault=frame["kind"], place=frame.index, **same, **told)


def test_severity_and_then_time_decide_what_to_fix_first() -> None:
    many = [("a/many", "S1", 1.0)] * 5
    some = [("b/slow", "S3", 9.0), ("c/fast", "S3", 8.0), ("d/both", "S3", 9.5), ("d/both", "", 9.0)]
    labels = {"S1": "light (severity S1)", "S3": "fatal (severity S3)"}
    answer = fix_first_answer(hazards(*some, *many), None, labels, has_alerts=True)
    lines = answer.tables[0].rows
    kinds = [line[0].text for line in lines if isinstance(line[0], PageLink)]
    assert kinds == ["d/both", "c/fast", "b/slow", "a/many"]
    assert lines[0][1] == PageLink(
        "1 fatal (severity S3), 1 without a class",
        "kind=d%2Fboth&warning=no%20alert%20at%20all,alert%20only%20after%20the%20hazard&severity=S3&sort=rank",
    )
    assert (
        "and 1 of 3 that are fatal (severity S3), the highest among the silent hazards." in answer.paragraph
    )


def untimed_path(by: str = "", stopped_at: tuple[str, ...] = ()) -> UntimedPath:
    """Return the path of a fault that reached its first actuator through the link `by`, or was stopped at
    these components."""
    entered = PathLink(name=by, tail=by, tip="pedals", state=LinkState.THROUGH) if by else None
    return UntimedPath(
        state_by_component={},
        inferred_ranks={},
        links=(),
        reached="",
        stopped_at=stopped_at,
        link_to_first_actuator=entered,
    )


def test_the_component_that_let_most_faults_through_is_named() -> None:
    untimed_paths = (untimed_path("feet"), untimed_path("hands"), untimed_path(stopped_at=("eyes",)))
    labels = {"feet": "Feet", "eyes": "Eyes"}
    structure = {"component_label": labels.__getitem__, "distinct_untimed_paths": untimed_paths}
    frame = hazards(*[("a/b", "S1", 1.0)] * 4).assign(untimed_path=[0, 0, 1, -1])
    masked = frame[:1].assign(experiment_id="masked", outcome="masked", untimed_path=2)
    answer = fix_first_answer(
        pd.concat([frame, masked]), cast(RunFaultPaths, SimpleNamespace(**structure)), {}, has_alerts=True
    )
    [line] = answer.tables[0].rows
    silent = "warning=no%20alert%20at%20all,alert%20only%20after%20the%20hazard"
    assert line[3:] == (
        PageLink("Feet: 2 of 4", f"kind=a%2Fb&{silent}&through=feet%E2%86%92pedals&sort=rank"),
        PageLink("Eyes: 1 of 5", "kind=a%2Fb&stopped_at=eyes"),
    )


def test_a_cause_shows_its_worst_experiment_and_how_many_more() -> None:
    """A fault type with many experiments of one hazard is one line, so that other causes are seen, too."""
    frame = hazards(*[("a/hit", "S1", 1.0)] * 12, *[("b/miss", "", 1.0)] * 12)
    frame = frame.assign(status="ok", t_h1=3.0, t_h2=4.0, h1=1.0, h2=1.0, sentence="It hits.")
    frame = frame.assign(scenario_label=frame["scenario"])
    frame.attrs["hazards"] = ("H1", "H2")
    metrics = [MetricFacts("margin_h1", "m", "", "lower"), MetricFacts("margin_h2", "s", "", "lower")]
    answer = most_dangerous_answer(frame, metrics, {"S1": "light (severity S1)"}, has_alerts=True)
    assert "12 light (severity S1), 12 without a class" in answer.paragraph
    hit, missed = answer.tables[0].rows
    assert hit[:4] == (
        ExplainedCodes(("S1",), "", "light (severity S1)"),
        PageLink("It hits.", "e=e0&outcome=hazard&sort=rank", "a/hit in S1, trigger C1"),
        ExplainedCodes(("H1", "H2")),
        "margin -2.00 s",
    )
    assert missed[0] == "no class"
    assert hit[-1] == PageLink("11", "kind=a%2Fhit&outcome=hazard&hazards=H1&sort=rank")
    frame = frame.assign(kind=[f"k/{i}" for i in frame.index])
    assert len(most_dangerous_answer(frame, metrics, {}, has_alerts=True).tables[0].rows) == 10


def test_tolerated_faults_are_a_share_of_the_activated_ones(answer_by_name: dict[str, ReportAnswer]) -> None:
    answer = answer_by_name["survived"]
    assert answer.paragraph == (
        "3 of 7 activated faults (43 %) led to no hazard: 2 changed no actuator (masked), 1 did (sdc). "
        "1 of 3 fault types (33 %) never led to a hazard."
    )
    weak, never = answer.tables
    assert [line[1] for line in weak.rows] == [ShareBar(1, 3, "1 of 3"), ShareBar(1, 3, "1 of 3")]
    assert never.rows == [(PageLink("car/steer", "kind=car%2Fsteer&outcome=masked,sdc"), "1")]


def test_cpu_time_is_added_up_by_fault_type(answer_by_name: dict[str, ReportAnswer]) -> None:
    answer = answer_by_name["time"]
    assert answer.paragraph == (
        "The experiments took 2 min 07 s of CPU time on 2 workers: 7 of 8 experiments (88 %) were "
        "simulated; for 1, the trigger never held, so the golden run's result was used. Median 8.00 s, "
        "longest 64.00 s. Checks, golden runs and the equivalence check are not timed."
    )
    [first, *_] = answer.tables[0].rows
    assert first == (PageLink("car/steer", "kind=car%2Fsteer"), ShareBar(64.0, 127.0, "1 min 04 s (50 %)"))


def part_of(run: ReportedRun, names: set[str]) -> ReportedRun:
    return replace(
        run,
        results=run.results[run.results["experiment_id"].isin(names)].reset_index(drop=True),
        frame=run.frame[run.frame["experiment_id"].isin(names)].reset_index(drop=True),
    )


def names_of(run: ReportedRun, empty: str) -> set[str]:
    return set(run.results["experiment_id"][run.results[empty].isna()])


def test_a_report_without_hazards_has_no_empty_table(run: ReportedRun) -> None:
    panel = build_answers_panel(part_of(run, names_of(run, "t_h1")))
    assert "0 of 3 activated faults (0 %) led to a hazard." in panel.markdown
    assert "## Which hazards were silent\n\nNo hazard occurred." in panel.markdown
    assert "| worst" not in panel.markdown
    assert "What to fix first" not in panel.markdown


def test_a_report_without_activated_faults_calls_none_tolerated(run: ReportedRun) -> None:
    idle = part_of(run, names_of(run, "t_activation"))
    found = {answer.html_name: answer for answer in build_answers(idle)}
    assert found["dangerous"].paragraph == found["survived"].paragraph == "No fault was activated."
    assert not any(answer.links for answer in found.values())
    assert found["time"].paragraph.startswith(
        "The experiments took 0 s of CPU time on 2 workers: 0 of 1 experiment (0 %) were simulated"
    )


def test_a_crash_is_not_tolerated(run: ReportedRun) -> None:
    frame = run.frame.assign(outcome=run.frame["outcome"].where(run.frame["kind"] != "car/steer", ""))
    found = {answer.html_name: answer for answer in build_answers(replace(run, frame=frame))}
    assert found["survived"].paragraph == (
        "2 of 7 activated faults (29 %) led to no hazard: 1 changed no actuator (masked), 1 did (sdc). "
        "1 crashed or timed out. 0 of 3 fault types (0 %) never led to a hazard, a crash or a timeout."
    )


def test_counts_of_one_use_the_singular(run: ReportedRun) -> None:
    found = {answer.html_name: answer for answer in build_answers(part_of(run, {"0" * 16, "1" * 16}))}
    assert found["unwarned"].paragraph.startswith("1 of 2 hazards (50 %) was silent")
    found = {answer.html_name: answer for answer in build_answers(part_of(run, {"0" * 16}))}
    assert "1 of 1 experiment (100 %) was simulated" in found["time"].paragraph


def test_link_values_are_escaped_and_the_sort_key_comes_last() -> None:
    assert (
        filtered_list_fragment({"kind": ["a/b,c"], "outcome": ["sdc"]}, "-t_end")
        == "kind=a%2Fb%2Cc&outcome=sdc&sort=-t_end"
    )
