"""What a report answers first, counted by hand."""

import csv
import json
from pathlib import Path

import pytest

from mutator.outcomes.columns import result_columns
from mutator.report.answers import Answer, Link, Part, answers_of, to_list
from mutator.report.panels.answers import answers_panel
from mutator.report.studies import ReportedRun
from mutator.store.run_folder import RunFolder

from .made_run import HEAD, make_run

METRICS = [
    ["margin_h1", "m", "how far it stayed from H1", "lower"],
    ["contact_speed", "m/s", "closing speed at contact", "higher"],
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
    """A made-up run of `RUNS`; the experiments cost 1, 2, 4, ... s of CPU time, the last one none."""
    make_run(tmp_path, metrics=METRICS)
    columns = [c.name for c in result_columns(("H1",), ("gas",), METRICS)]
    with (tmp_path / "results.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, columns, restval="")
        table.writeheader()
        for i, (kind, outcome, active, hazard, alerts, alert, speed, margin) in enumerate(RUNS):
            module, fault_type = kind.split("/")
            line = {"module": module, "fault_type": fault_type, "outcome": outcome, "status": "ok"}
            line |= {"t_activation": active, "h1": int(hazard != ""), "t_h1": hazard, "alerts": alerts}
            line |= {"t_alert": alert, "contact_speed": speed, "margin_h1": margin, "scenario": "S1"}
            line |= {"experiment_id": f"{i}" * 16, "fault_id": f"f{i}", "method": "guided", "trigger": "C1"}
            line |= {"t_manifest": 2.5 if outcome in ("hazard", "sdc") else "", "variant": "x"}
            line |= {"reaction_time": hazard - alert if alerts and alert < hazard else ""}
            table.writerow(line)
    costs = [{"experiment_id": f"{i}" * 16, "cpu_s": 2.0**i, "worker": f"w{i % 2}"} for i in range(7)]
    lines = [
        {"schema": "timings/1", "plan": HEAD["plan"]},
        *costs,
        costs[0] | {"experiment_id": "7" * 16, "cpu_s": 0},
    ]
    (tmp_path / "timings").mkdir()
    (tmp_path / "timings" / "0001-main.jsonl").write_text("".join(f"{json.dumps(line)}\n" for line in lines))
    return ReportedRun.open(RunFolder.open(tmp_path), None)


@pytest.fixture
def said(run: ReportedRun) -> dict[str, Answer]:
    """The answers by name."""
    return {answer.name: answer for answer in answers_of(run)}


def test_the_worst_experiment_is_first(said: dict[str, Answer]) -> None:
    """Harder contact first, then the smaller margin; each row opens its experiment."""
    answer = said["dangerous"]
    assert (
        answer.says
        == "4 of 7 activated faults (57 %) led to a hazard. 2 of 4 hazards (50 %) came with contact."
    )
    worst, kinds = answer.listings
    assert [line[0] for line in worst.lines] == [
        Link("radar/chaff/x", f"e={'1' * 16}"),
        Link("radar/chaff/x", f"e={'0' * 16}"),
        Link("car/speed/x", f"e={'4' * 16}"),
        Link("car/speed/x", f"e={'3' * 16}"),
    ]
    assert worst.heads[3:] == ("how bad", "hazard after", "alert before")
    assert [line[3:] for line in worst.lines] == [
        ("contact at 9.00 m/s", "4.00 s", "fcw, 1.0 s"),
        ("contact at 4.00 m/s", "3.00 s", "none"),
        ("margin -0.50 m", "7.00 s", "none"),
        ("margin -0.25 m", "5.00 s", "too late"),
    ]
    assert [line[1] for line in kinds.lines] == [Part(2, 3, "2 of 3"), Part(2, 3, "2 of 3")]
    assert answer.links == (Link("All 4 hazards", "outcome=hazard&sort=rank"),)


def test_an_alert_after_the_hazard_is_no_warning(said: dict[str, Answer]) -> None:
    """Three of four hazards had no alert before, one of them an alert too late."""
    answer = said["unwarned"]
    assert (
        answer.says == "3 of 4 hazards (75 %) came with no alert before; in 1 of these an alert came later."
    )
    assert [line[1] for line in answer.listings[0].lines] == [Part(2, 2, "2 of 2"), Part(1, 2, "1 of 2")]
    assert answer.links[0].to == "warning=no%20alert,alert%20after%20the%20hazard"


def test_what_was_survived_is_counted_of_what_was_activated(said: dict[str, Answer]) -> None:
    """A fault that never became active was not survived; the weakest fault type is first."""
    answer = said["survived"]
    assert answer.says == (
        "3 of 7 activated faults (43 %) led to no hazard: 2 changed no actuator, 1 did. "
        "1 of 3 fault types (33 %) never led to one."
    )
    assert [line[1] for line in answer.listings[0].lines][-1] == Part(1, 1, "1 of 1")


def test_time_is_that_of_the_experiments_by_fault_type(said: dict[str, Answer]) -> None:
    """The costliest fault type is first; an experiment that was not driven costs nothing."""
    answer = said["time"]
    assert answer.says == (
        "2 min 07 s of CPU time, by 2 workers: 7 of 8 experiments (88 %) were driven; the others needed no "
        "run of their own. Median 8.00 s, longest 64.00 s."
    )
    [first, *_] = answer.listings[0].lines
    assert first == (Link("car/steer", "kind=car%2Fsteer"), Part(64.0, 127.0, "1 min 04 s (50 %)"))


def test_a_run_without_hazards_says_so(run: ReportedRun) -> None:
    """No empty table, and no share of nothing."""
    fine = [row for row in run.rows if not row.hazards]
    frame = run.frame[run.frame["outcome"] != "hazard"].reset_index(drop=True)
    calm = ReportedRun(
        **{name: getattr(run, name) for name in ("folder", "workspace", "engines", "study")},
        rows=tuple(fine),
        frame=frame,
    )
    panel = answers_panel(calm)
    assert "0 of 3 activated faults (0 %) led to a hazard." in panel.markdown
    assert "0 of 0 hazards came with no alert before." in panel.markdown
    assert "the worst" not in panel.markdown


def test_a_link_names_facets_as_the_page_reads_them() -> None:
    """Values are escaped, the order stands last."""
    assert (
        to_list({"kind": ["a/b,c"], "outcome": ["sdc"]}, "-t_end") == "kind=a%2Fb%2Cc&outcome=sdc&sort=-t_end"
    )
