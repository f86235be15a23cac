"""The search for the threshold of the detector as coded, run on a few images."""

import pytest
from selfdrive.visiond import authors_code_detector
from selfdrive.visiond_lab import calibrate_authors_code


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calibrate_authors_code, "PICTURE_COUNT", 3)
    monkeypatch.setattr(calibrate_authors_code, "TRIED_THRESHOLDS", [-50.0, 3.5, 4.0, 4.5, 50.0])


def test_the_lowest_threshold_marks_all_windows_and_the_highest_none() -> None:
    found = calibrate_authors_code.evaluate_thresholds()
    assert [row[0] for row in found] == calibrate_authors_code.TRIED_THRESHOLDS
    marked = [row[1] for row in found]
    assert marked == sorted(marked, reverse=True)
    assert (marked[0], marked[-1]) == (1.0, 0.0)
    assert found[0][2] == 1.0


def test_the_middle_of_the_acceptable_thresholds_is_printed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A threshold is rejected if it marks too many windows, even if it reads the lines well, or if it
    misreads more lines than others.
    """
    rows = [(1.0, 0.004, 0.0), (2.0, 0.003, 0.1), (3.0, 0.002, 0.02), (4.0, 0.001, 0.02), (5.0, 0.0, 0.02)]
    monkeypatch.setattr(calibrate_authors_code, "evaluate_thresholds", lambda: rows)
    calibrate_authors_code.main()
    *told, chosen = capsys.readouterr().out.splitlines()
    assert (len(told), chosen) == (5, "4.00")
    assert told[0] == " 1.00: 0.40% of the windows inside the lane marked, 0.0% of the pictures off"


@pytest.mark.slow
def test_the_stored_threshold_is_the_one_that_the_search_finds(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """After a change of the net, the road or the rule, search again."""
    monkeypatch.undo()
    calibrate_authors_code.main()
    assert float(capsys.readouterr().out.splitlines()[-1]) == authors_code_detector.MIN_LOG_ODDS
