"""The threshold of the detector as coded, found on few pictures."""

import pytest
from selfdrive.visiond import coded_threshold


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coded_threshold, "PICTURES", 3)
    monkeypatch.setattr(coded_threshold, "TRIED", [-50.0, 3.5, 4.0, 4.5, 50.0])


def test_the_least_marks_all_and_the_largest_none() -> None:
    """The share of marked windows falls from one to nothing."""
    found = coded_threshold.thresholds()
    assert [row[0] for row in found] == coded_threshold.TRIED
    marked = [row[1] for row in found]
    assert marked == sorted(marked, reverse=True)
    assert (marked[0], marked[-1]) == (1.0, 0.0)
    assert found[0][2] == 1.0


def test_the_middle_of_those_that_will_do_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    """One that marks more than it may is out, however well it reads."""
    coded_threshold.main()
    *rows, chosen = capsys.readouterr().out.splitlines()
    assert len(rows) == 5
    assert float(chosen) in {3.5, 4.0, 4.5, 50.0}
    assert rows[0].startswith("-50.00: 100.00% of the windows inside the lane marked, 100.0%")
