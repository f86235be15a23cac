"""The order of results, worst first."""

import csv
import random
from collections.abc import Iterable
from pathlib import Path

from mutator.results.column_facts import SEVERITY, result_columns
from mutator.results.ranking import places, worst, worth, worth_of
from mutator.results.table_reader import Results
from mutator.targets.target_facts import MetricFacts

METRICS = [MetricFacts(name, "-", "", "lower") for name in ("margin_h1", "margin_h2", "margin_h3", "delta_v")]
COLUMNS = [column.name for column in result_columns(("H1", "H2", "H3"), ("gas",), METRICS, (SEVERITY,))]
OK = {
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
CONTACT = HAZARD | {"t_h1": "2", "severity": "S2", "delta_v": "6"}
WORST_FIRST = {
    "s3": CONTACT | {"severity": "S3", "delta_v": "12"},
    "s2-harder": CONTACT | {"delta_v": "7"},
    "s2-a": CONTACT,
    "s2-b": CONTACT,
    "s0": CONTACT | {"severity": "S0", "delta_v": "0"},
    # H2 and H3 alternate, although H3's numbers are larger; only margins of hazards that occurred are used
    "deep-2": HAZARD | {"margin_h2": "-0.3"},
    "deep-3": LEFT | {"margin_h3": "-500"},
    "both": LEFT | {"t_h2": "3", "margin_h2": "-0.2", "margin_h3": "-2"},  # second by H2, third by H3
    "second-3": LEFT | {"margin_h3": "-100"},
    "third-2": HAZARD | {"margin_h2": "-0.1", "margin_h3": "-9"},
    "fourth-3": LEFT | {"margin_h3": "-1"},
    "no-margin": HAZARD,
    "crash": OK | {"status": "crashed"},
    "near-1": OK | {"outcome": "sdc", "margin_h1": "1"},
    "near-2": OK | {"outcome": "sdc", "margin_h1": "5", "margin_h2": "0.5"},
    "second-1": OK | {"outcome": "sdc", "margin_h1": "2", "margin_h2": "9"},
    "masked": OK | {"outcome": "masked", "margin_h1": "0.1"},
    "idle": OK | {"outcome": "not_activated"},
    "no-result": OK | {"status": "harness_error"},
}


def results(run: Path, lines: Iterable[dict[str, str]]) -> Results:
    """Return the results of a made-up run folder, with these lines in its table."""
    (run / "run.json").write_text('{"schema": "run/3", "hazards": ["H1", "H2", "H3"]}')
    with (run / "results.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, COLUMNS, restval="")
        table.writeheader()
        table.writerows(lines)
    return Results.of_run(run)


def test_the_worst_results_come_first(tmp_path: Path) -> None:
    """The order is by severity class, then by delta-v. Without a class, it is by ending, then by the margin
    of each hazard. Ids decide ties."""
    table = results(tmp_path, [line | {"experiment_id": name} for name, line in WORST_FIRST.items()])
    rows = list(table.rows())
    random.Random(1).shuffle(rows)
    assert [row.experiment_id for row in worst(rows)] == list(WORST_FIRST)


def test_columns_and_rows_are_ranked_in_the_same_order(tmp_path: Path) -> None:
    draw = random.Random(3)
    choices = list(WORST_FIRST.values())
    lines = [dict(draw.choice(choices)) for _ in range(400)]
    for i, line in enumerate(lines):
        line["experiment_id"] = f"{draw.randrange(10**6):06}-{i}"
        for name in ("margin_h1", "margin_h2", "margin_h3"):
            if draw.random() < 0.3:
                line[name] = str(draw.randint(-3, 3))
    found = results(tmp_path, lines)
    texts = found.texts()
    order = texts["experiment_id"].to_numpy()[places(texts).argsort()]
    assert list(order) == [row.experiment_id for row in worst(found.rows())]
    assert worth_of(texts) == worth(found.rows())
