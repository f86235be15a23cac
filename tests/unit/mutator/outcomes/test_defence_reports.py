"""The report of a run on its defences."""

import json
from pathlib import Path

import pytest

from mutator.errors import BadOutput
from mutator.outcomes.defence_reports import load_activities
from mutator.targets.manifest import DEFENCE_REPORT_FILE

ACTED = {"first": 1.0, "last": 2.0, "activations": 1, "steps": 3, "conflicts": 0}
ACTED |= {"changes": {"gas": 0.5}, "values": {"gas": 0.0}}


def test_defences_are_found_in_a_report_of_another_order(tmp_path: Path) -> None:
    """A report has the order in which they act, and a run folder that of the campaign."""
    (tmp_path / DEFENCE_REPORT_FILE).write_text(json.dumps({"aeb": ACTED, "driver": ACTED}))
    activities = load_activities(["driver", "aeb"], ["gas"], tmp_path)
    assert [activity.name for activity in activities] == ["driver", "aeb"]


@pytest.mark.parametrize("report", [[], {"aeb": ACTED}, {"aeb": ACTED, "driver": ACTED, "x": ACTED}])
def test_a_report_on_other_defences_is_damaged(tmp_path: Path, report: object) -> None:
    (tmp_path / DEFENCE_REPORT_FILE).write_text(json.dumps(report))
    with pytest.raises(BadOutput, match="damaged"):
        load_activities(["driver", "aeb"], ["gas"], tmp_path)
