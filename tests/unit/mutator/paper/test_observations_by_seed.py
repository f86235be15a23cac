"""The number of seeds that show each observation, for made-up results."""

from pathlib import Path
from typing import Any

import pandas as pd

from mutator.paper.observation_judging import ClaimVerdict, judge_observations
from mutator.paper.observations_by_seed import (
    judge_by_seed,
    observations_by_seed_sheet,
    verdicts_by_seed_table,
)

from ..statistics.results_frame import results

OBSERVATIONS = """\
schema: paper_observations/1
source: made up
observations:
  - title: Most faults are hazards.
    claims:
      - {says: most are, measure: share, of: is_activated, part: is_hazard, holds: {above: 0.5}, needed: true}
      - {says: all are, measure: share, of: is_activated, part: is_hazard, holds: {above: 0.99}}
  - title: There are alerts.
    claims:
      - says: one has
        measure: share
        of: is_activated
        part: is_alert
        holds: {some: 0.3}
        needed: true
        mixture: true
"""


def seed(number: int, hazards: int, *, alert: bool = False) -> list[dict[str, Any]]:
    """Return twenty activated runs with one seed; the first `hazards` of them have a hazard."""
    ran = {"seed": number, "t_activation": 1.0}
    made = [ran | ({"h1": 1, "t_h1": 2.0} if i < hazards else {}) for i in range(20)]
    return [made[0] | ({"t_alert": 3.0} if alert else {}), *made[1:]]


def frame() -> pd.DataFrame:
    """Return runs in which seed 3 shows the first observation, seed 1 contradicts it, and two seeds are
    undecided. All seeds except 12 show the second observation."""
    return results(*seed(11, 11, alert=True), *seed(3, 20, alert=True), *seed(1, 0, alert=True), *seed(12, 9))


def test_seeds_that_show_each_observation_are_counted(tmp_path: Path) -> None:
    file = tmp_path / "observations.yaml"
    file.write_text(OBSERVATIONS)
    found = judge_by_seed(file, frame(), lambda runs: [])
    assert list(found) == ["1", "3", "11", "12"]
    rows = verdicts_by_seed_table(judge_observations(file, frame(), []), found).rows
    assert [row[2:] for row in rows] == [
        (ClaimVerdict.UNDECIDED, "1", "1", "2", "4"),
        (ClaimVerdict.HOLDS, "3", "1", "0", "4"),
    ]
    lines = observations_by_seed_sheet(found).lines
    assert len(lines) == 8 and lines[2][:4] == (3, 1, "holds", "1.1")


def test_a_claim_about_all_faults_is_undecided_for_a_seed_without_all_fault_types(tmp_path: Path) -> None:
    file = tmp_path / "observations.yaml"
    file.write_text(OBSERVATIONS)
    found = judge_by_seed(file, frame(), lambda runs: ["a type"] if set(runs["seed"]) == {3} else [])
    assert [found[name][1].verdict for name in ("1", "3")] == [ClaimVerdict.HOLDS, ClaimVerdict.UNDECIDED]
    assert judge_by_seed(file, results(*seed(1, 5)), lambda runs: []) == {}
