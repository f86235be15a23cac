"""`trial.json` is read as it was written, or refused."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.errors import MutatorError
from mutator.model import Experiment, Record
from mutator.store.trial_file import TRIAL_FILE, StoredTrial


@pytest.mark.parametrize("changed", [{"detail": 5}, {"t_manifest": "x"}, {"metrics": [["gap", "wide"]]}])
def test_values_of_other_types_are_refused(
    tmp_path: Path,
    experiment: Callable[..., Experiment],
    record: Callable[..., Record],
    changed: dict[str, Any],
) -> None:
    """A page that shows them would fail."""
    one = experiment()
    trial = StoredTrial(target="car", sources={}, experiment=one, record=record(one.id))
    trial.write(tmp_path)
    assert StoredTrial.read(tmp_path) == trial
    stored = json.loads((tmp_path / TRIAL_FILE).read_text())
    (tmp_path / TRIAL_FILE).write_text(json.dumps(stored | {"record": stored["record"] | changed}))
    with pytest.raises(MutatorError, match="a damaged trial"):
        StoredTrial.read(tmp_path)
