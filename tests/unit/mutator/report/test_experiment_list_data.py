"""The data on experiments in a page: columns, details and images."""

from collections.abc import Callable
from math import inf, nan
from pathlib import Path

import pytest

from mutator._common.files import write_json
from mutator.model import Experiment
from mutator.report import experiment_list_data
from mutator.report.experiment_facts import RANK_COLUMN
from mutator.report.experiment_list_data import (
    column_data,
    details_data,
    media_by_experiment,
    results_table_data,
)
from mutator.review.patch_shapes import shapes_of_patches
from mutator.store.run_folder import RunFolder
from tests.made_head import made_head

from ..statistics.results_frame import results

PATCH = """\
diff --git a/pkg/radar.py b/pkg/radar.py
--- a/pkg/radar.py
+++ b/pkg/radar.py
@@ -1,2 +1,3 @@
 d_rel = see()
+d_rel = d_rel + {}.0  # fi:0a1b2c3d
 v_rel = 0
"""


@pytest.mark.parametrize(
    ("name", "values", "made"),
    [
        ("t_h1", [2.5, nan, 3.0], {"numbers": [2.5, None, 3]}),
        ("max_dev_gas", [inf, nan, -inf], {"numbers": ["Infinity", None, "-Infinity"]}),
        ("scenario", ["S2", "S1", "S2"], {"words": ["S1", "S2"], "codes": [1, 0, 1]}),
        ("experiment_id", ["12", "34"], {"texts": ["12", "34"]}),
        ("alerts", ["", ""], {"words": [""], "codes": [0, 0]}),
        ("t_alert", [nan, nan], {"words": [""], "codes": [0, 0]}),
        ("seed", [7, 2**60], {"numbers": [7, 2.0**60]}),
        ("value", ["3", "left"], {"words": ["3", "left"], "codes": [0, 1]}),
        ("scenario", ["S2", "S1"], {"words": ["S1", "S2"], "codes": [1, 0]}),
        ("variant", ["nan"], {"words": ["nan"], "codes": [0]}),
    ],
)
def test_columns_are_numbers_dictionaries_or_texts(name: str, values: list[object], made: object) -> None:
    assert column_data(name, values) == made


def test_a_target_without_alerts_has_no_alert_columns() -> None:
    line = {"fault_type": "chaff"}
    frame = results(line).assign(reading="", variant="", value=nan, unit="", detail="", outcome="")
    frame = frame.assign(reaction_time=nan, **{RANK_COLUMN: 0})
    names = [
        {made["name"] for made in results_table_data(frame, {}, has_alerts=has)["columns"]}
        for has in (True, False)
    ]
    assert names[0] - names[1] == {"alerts", "t_alert", "reaction_time", "warning"}
    assert "detail" in names[1]


def test_diffs_are_stored_as_shapes_and_values(experiment: Callable[..., Experiment]) -> None:
    one, two = experiment(3.0), experiment(4.0)
    ids = [two.id, "none", one.id]
    patches = [(two.id, "", PATCH.format(4)), (one.id, "", PATCH.format(3))]
    made = details_data([two, None, one], shapes_of_patches(patches), ids, ["2" * 16, "", "1" * 16])
    assert made["shape"] == [0, -1, 0] and made["trace"] == ["2" * 16, "", "1" * 16]
    [shape] = made["shapes"]
    values = list(zip(*shape["values"], strict=True))
    for member, number in enumerate((4, 3)):
        filled = [values[member][place] for place in shape["places"]]
        text = "".join(a + b for a, b in zip(shape["parts"], [*filled, ""], strict=True))
        assert text == PATCH.format(number)
    assert made["spec"] == [0, -1, 1]
    assert "after_assign: d_rel" in made["specs"][0]
    assert made["settings"] == [{"hold": "while", "hold_s": None, "armed_after_s": 1.5, "changes": []}]


def test_pictures_beyond_the_budget_are_links(tmp_path: Path) -> None:
    write_json(tmp_path / "run.json", made_head())
    plots = tmp_path / "plots"
    plots.mkdir()
    for name in ("aa-2.00s.jpg", "aa-10.00s.jpg", "aa.mp4", "bb.svg"):
        (plots / name).write_bytes(b"1234")
    made = media_by_experiment(
        RunFolder.open_unverified(tmp_path), tmp_path / "report", most_embedded_bytes=5
    )
    assert made == {
        "aa": {
            "stills": [["2.00", "data:image/jpeg;base64,MTIzNA=="], ["10.00", "../plots/aa-10.00s.jpg"]],
            "films": ["../plots/aa.mp4"],
        },
        "bb": {"stills": [], "films": [], "plot": "../plots/bb.svg"},
    }


def test_the_list_does_not_depend_on_the_order_of_results() -> None:
    frame = results({"experiment_id": "b"}, {"experiment_id": "a"}, {"module": "car"})
    listed = frame.sort_values(experiment_list_data.LIST_SORT_COLUMNS)
    assert list(listed["experiment_id"]) == ["2", "a", "b"]
