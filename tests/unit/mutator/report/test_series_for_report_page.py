"""The reason why a page has no series of an experiment."""

from pathlib import Path

import pytest

from mutator._common.hashing import as_json_types
from mutator.store import file_digests
from mutator.store.file_digests import DigestLedger
from mutator.store.missing_series import reason_for_missing_series
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder

from .made_run import make_run


@pytest.mark.parametrize(
    ("series_mb", "is_packed", "is_finished", "reason"),
    [
        (0, False, True, "--series-mb 0"),
        (3, True, True, "fill the run's 3 MB"),
        (None, True, True, "fill the run's 500 MB"),
        (None, False, False, "was not finished"),
        (None, False, True, "folder `series` was removed"),
    ],
)
def test_the_reason_for_a_missing_series_is_the_true_one(
    tmp_path: Path, series_mb: int | None, is_packed: bool, is_finished: bool, reason: str
) -> None:
    run = make_run(tmp_path, choices=as_json_types(Choices(series_mb=series_mb)))
    file_digests.save_ledger(run, DigestLedger(files={}, finished=is_finished))
    folder = RunFolder.open_unverified(run)
    assert reason in reason_for_missing_series(folder, is_packed=is_packed)
