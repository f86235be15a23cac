"""What jobs say about their golden runs."""

import pytest

from mutator.engines.engine_jobs import GoldenEnd


@pytest.mark.parametrize(
    ("rows_before", "row_count", "step", "expected"),
    [
        (80, 120, 79, True),
        (80, 120, 80, False),  # the last row before the end could be one before the first step
        (80, 121, 79, True),
        (80, 60, 10, False),  # not each step has a row
        (80, 240, 10, False),
    ],
)
def test_a_run_is_known_to_reach_a_step_only_if_its_rows_are_those_of_its_steps(
    rows_before: int, row_count: int, step: int, expected: bool
) -> None:
    end = GoldenEnd(rows_before=rows_before, row_count=row_count)
    assert end.is_after_step(step, step_count=120) is expected
