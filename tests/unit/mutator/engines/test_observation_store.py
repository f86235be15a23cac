"""Stored observations of golden runs: what counts, and what does not."""

from pathlib import Path

import pytest

from mutator.engines.first_activation import GoldenObservations
from mutator.engines.observation_store import ObservationStore

OBSERVATIONS = GoldenObservations(
    values=((0.0, 1.5),), counts_before_steps=(0, 1), imported_modules=("json",)
)


def test_stored_observations_are_loaded(tmp_path: Path) -> None:
    """All workers of a session share a secret, so each can use what another stored."""
    ObservationStore(tmp_path, b"secret").save("a", OBSERVATIONS)
    loaded = ObservationStore(tmp_path, b"secret").load("a")
    assert loaded is not None
    assert (loaded.values, loaded.counts_before_steps) == (((0.0, 1.5),), (0, 1))
    assert loaded.imported_modules == ("json",)


@pytest.mark.parametrize("forged", [b"", b"short", bytes(32), bytes(80)])
def test_files_of_mutants_do_not_count(tmp_path: Path, forged: bytes) -> None:
    """A mutant can write to the folder, but does not know the secret."""
    store = ObservationStore(tmp_path, b"secret")
    assert store.load("a") is None
    (tmp_path / "observed-a").write_bytes(forged)
    assert store.load("a") is None
    ObservationStore(tmp_path, b"other").save("a", OBSERVATIONS)
    assert store.load("a") is None
