"""The table of the worst experiments."""

from mutator.cli.experiment_printing import without_unused_columns


def test_a_target_without_classes_or_alerts_has_no_columns_for_them() -> None:
    """A column stays if one row has a value, also 0."""
    rows = [
        {"severity": "", "delta-v [m/s]": None, "first alert": "", "margin": None, "more": 0},
        {"severity": "", "delta-v [m/s]": 0.0, "first alert": "", "margin": None, "more": 2},
    ]
    assert [list(row) for row in without_unused_columns(rows)] == [["delta-v [m/s]", "margin", "more"]] * 2
