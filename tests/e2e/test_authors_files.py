"""The fault files that the paper's authors published are read to the last line, where a checkout is at hand.

Set MUTATOR_UVA to a folder with checkouts of UVA-DSA/OpenpilotWithVision and UVA-DSA/openpilot. They are not
part of this project.
"""

import csv
import os
from collections import Counter
from pathlib import Path

import pytest

from mutator.execution.campaign_running import run_campaign
from mutator.onboarding.library_import import EntryOutcome, import_into_new_library
from mutator.paper.uva_library import import_fault_files
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace

CHECKOUTS = os.environ.get("MUTATOR_UVA")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not CHECKOUTS, reason="MUTATOR_UVA names no folder with the authors' repositories"),
]


def checkout(name: str) -> Path:
    return Path(CHECKOUTS or "") / name


@pytest.mark.parametrize(
    ("name", "files", "counts"),
    [("OpenpilotWithVision", 26, (212, 71, 0)), ("openpilot", 38, (304, 2, 49))],
)
def test_every_line_is_read(name: str, files: int, counts: tuple[int, int, int]) -> None:
    imported = import_fault_files(checkout(name))
    assert len({entry.file for entry in imported.entries}) == files
    assert tuple(imported.count(outcome) for outcome in EntryOutcome) == counts


def test_the_lines_that_cannot_be_imported_are_those_without_a_place() -> None:
    """adaptivecruise.py is not in v0.4.2, the car itself gets no fault, and one file has no values."""
    refused = [entry for entry in import_fault_files(checkout("openpilot")).entries if entry.reason]
    by_file = Counter(int(Path(entry.file).stem.removeprefix("scenario_")) for entry in refused)
    assert by_file == {16: 14, 22: 16, 25: 15, 35: 1, 36: 1, 37: 1, 38: 1}


def test_radar_faults_end_as_they_did_on_the_original(tmp_path: Path) -> None:
    """Of the authors' 24 distances, 18 ended in a collision, from 14.8 to 26.1 s."""
    import_into_new_library("uva", checkout("OpenpilotWithVision"), tmp_path / "library")
    summary = run_campaign(
        Workspace.find(root=tmp_path / "library"),
        "uva_hwt_from_0_and_hwt_to_2",
        tmp_path / "run",
        workers=2,
        choices=Choices(only='fault_type == "uva_1"'),
    )
    assert summary.exit_code == 0
    with (tmp_path / "run" / "results.csv").open() as file:
        rows = list(csv.DictReader(file))
    times = sorted(float(row["t_h1"]) for row in rows if row["h1"] == "1")
    assert len(rows) == 24 and len(times) == 18
    assert (times[0], times[-1]) == pytest.approx((14.8, 26.1), abs=0.1)
