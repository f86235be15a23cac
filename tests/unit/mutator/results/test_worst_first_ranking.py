"""The order of results, worst first."""

import json
import math
import random
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import pandas as pd

from mutator.model import Status
from mutator.results.result_rows import ResultRow, rows_of
from mutator.results.severity_and_sentence_columns import severity_and_time_columns
from mutator.results.table_columns import result_columns
from mutator.results.table_reader import Results
from mutator.results.worst_first_ranking import (
    causes_of,
    worst_first_rank_by_ok_experiment,
    worst_first_ranks,
    worst_of_each_cause,
)
from mutator.targets.hazard_severity import SEVERITY_CLASSES
from mutator.targets.stored_target_facts import MetricFacts
from tests.made_head import made_head
from tests.made_up_results import write_results

METRICS = [
    MetricFacts(name, "-", "", "lower")
    for name in ("t_end", "margin_h1", "margin_h2", "margin_h3", "delta_v")
]
COLUMNS = result_columns(("H1", "H2", "H3"), ("gas",), METRICS, severity_and_time_columns(has_classes=True))
HEAD = made_head(
    compared=["gas"],
    metrics=METRICS,
    severity={"name": "x", "about": "", "source": "", "classes": [["S0", 0.0, ""]]},
)
OK = {
    "fault_id": "f",
    "module": "m",
    "fault_type": "f",
    "scenario": "S1",
    "method": "guided",
    "status": "ok",
    "h1": "0",
    "h2": "0",
    "h3": "0",
}
HAZARD = OK | {"outcome": "hazard", "t_activation": "1", "t_h2": "3", "margin_h1": "-9"}
LEFT = OK | {"outcome": "hazard", "t_activation": "1", "t_h3": "3", "margin_h1": "-9"}
CONTACT = OK | {
    "outcome": "hazard",
    "t_activation": "1",
    "h1": "1",
    "t_h1": "2",
    "t_end": "2",
    "margin_h1": "-9",
    "severity": "S2",
    "delta_v": "6",
}
FAST = CONTACT | {"time_to_hazard": "1"}
WARNED = {"reaction_time": "0.5"}
WORST_FIRST = {
    "s3": CONTACT | {"severity": "S3", "delta_v": "12"},
    # in a class, a lane departure alternates with contacts
    "s3-left": LEFT | {"severity": "S3", "margin_h3": "-2"},
    "s3-softer": CONTACT | {"severity": "S3", "delta_v": "11"},
    "s3-warned": CONTACT | {"severity": "S3", "delta_v": "20"} | WARNED,
    "s2-harder": CONTACT | {"delta_v": "7", "margin_h1": "-0.1"},  # the margin of a contact says nothing
    "s2-z-sooner": FAST,
    "s2-a": CONTACT,
    "s2-b": CONTACT,
    "s0": CONTACT | {"severity": "S0", "delta_v": "0"},
    # H2 and H3 alternate, although H3's numbers are larger; only margins of hazards that occurred are used
    "deep-3": LEFT | {"margin_h3": "-500", "time_to_hazard": "2"},
    "deep-2": HAZARD | {"margin_h2": "-0.3"},
    "both": LEFT | {"t_h2": "3", "margin_h2": "-0.2", "margin_h3": "-2"},  # second by H2, third by H3
    "second-3": LEFT | {"margin_h3": "-100"},
    "third-2": HAZARD | {"margin_h2": "-0.1", "margin_h3": "-9"},
    "fourth-3": LEFT | {"margin_h3": "-1"},
    "no-margin": HAZARD,
    "warned": LEFT | {"margin_h3": "-900"} | WARNED,
    "crash": OK | {"status": "crashed"},
    "near-1": OK | {"outcome": "sdc", "margin_h1": "1"},
    "near-2": OK | {"outcome": "sdc", "margin_h1": "5", "margin_h2": "0.5"},
    "second-1": OK | {"outcome": "sdc", "margin_h1": "2", "margin_h2": "9"},
    "masked": OK | {"outcome": "masked", "margin_h1": "0.1"},
    "idle": OK | {"outcome": "not_activated"},
    "no-result": OK | {"status": "harness_error"},
}


def frame_of(run: Path, lines: Iterable[dict[str, str]]) -> pd.DataFrame:
    """Return the results of a made-up run folder, with these lines in its table."""
    (run / "run.json").write_text(json.dumps(HEAD))
    write_results(run, COLUMNS, lines)
    return Results(run).frame()


def test_the_worst_results_come_first(tmp_path: Path) -> None:
    """The order is by severity class or ending, silent hazards first, then by the margin of each hazard, and
    by time. Ids decide ties."""
    lines = [line | {"experiment_id": name} for name, line in WORST_FIRST.items()]
    random.Random(1).shuffle(lines)
    frame = frame_of(tmp_path, lines)
    assert list(frame["experiment_id"].to_numpy()[worst_first_ranks(frame).argsort()]) == list(WORST_FIRST)


_ENDINGS = [
    "hazard",
    "crashed",
    "timeout",
    "sdc",
    "masked",
    "not_activated",
    "invalid_mutant",
    "harness_error",
]


def ranked_one_by_one(rows: Sequence[ResultRow], times: Mapping[str, float]) -> list[ResultRow]:
    """Rank rows by the same rules, without columns."""
    inf = math.inf

    def group(row: ResultRow) -> tuple[int, int, bool]:
        severity = SEVERITY_CLASSES.index(row.severity) if row.severity else -1
        return (-severity, _ENDINGS.index(row.ending), row.reaction_time is not None)

    def time(row: ResultRow) -> float:
        return times.get(row.experiment_id, inf)

    lines: dict[tuple[object, str], list[tuple[float, float, str]]] = {}
    for row in rows:
        margins = dict(row.margins)
        if row.delta_v is not None:
            margins |= {name: -row.delta_v for name, t in row.hazards if t == row.t_end}
        for hazard, margin in margins.items():
            lines.setdefault((group(row), hazard), []).append((margin, time(row), row.experiment_id))
    turns: dict[str, int] = {}
    for line in lines.values():
        for turn, (*_, name) in enumerate(sorted(line)):
            turns[name] = min(turn, turns.get(name, turn))

    def badness(row: ResultRow) -> tuple[object, ...]:
        return (group(row), turns.get(row.experiment_id, inf), time(row), row.experiment_id)

    return sorted(rows, key=badness)  # type: ignore[arg-type]


def test_many_results_are_ranked_by_the_same_rules(tmp_path: Path) -> None:
    draw = random.Random(3)
    choices = list(WORST_FIRST.values())
    lines = [dict(draw.choice(choices)) for _ in range(400)]
    for i, line in enumerate(lines):
        line["experiment_id"] = f"{draw.randrange(10**6):06}-{i}"
        for name in ("margin_h1", "margin_h2", "margin_h3"):
            if draw.random() < 0.3:
                line[name] = str(draw.randint(-3, 3))
    frame = frame_of(tmp_path, lines)
    order = frame["experiment_id"].to_numpy()[worst_first_ranks(frame).argsort()]
    times = frame.set_index("experiment_id")["time_to_hazard"].dropna().to_dict()
    ranked = ranked_one_by_one(rows_of(frame, {}), times)
    assert list(order) == [row.experiment_id for row in ranked]
    assert worst_first_rank_by_ok_experiment(frame) == {
        r.experiment_id: i for i, r in enumerate(ranked) if r.status is Status.OK
    }


def test_a_cause_is_a_fault_type_and_a_hazard(tmp_path: Path) -> None:
    """The hazard is the one that has the class, or else the first; of each cause, the worst row remains."""
    lines = [
        CONTACT | {"severity_hazard": "H3", "t_h3": "1", "h3": "1"},
        LEFT | {"h3": "1"},
        HAZARD | {"h2": "1"},
        LEFT | {"h3": "1", "fault_type": "g"},
        LEFT | {"h3": "1"},
        OK | {"outcome": "masked"},
    ]
    frame = frame_of(tmp_path, [line | {"experiment_id": f"e{i}"} for i, line in enumerate(lines)])
    assert list(causes_of(frame)["hazard"]) == ["H3", "H3", "H2", "H3", "H3", ""]
    worst, more = worst_of_each_cause(frame)
    assert list(zip(worst["experiment_id"], more, strict=True)) == [
        ("e0", 2),
        ("e2", 0),
        ("e3", 0),
        ("e5", 0),
    ]
