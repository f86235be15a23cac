"""A pass makes room for itself, whatever the command before it left."""

from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.execution.watched_campaign import WatchedCampaign
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace


@pytest.fixture
def passes(toycar: Workspace, tmp_path: Path) -> WatchedCampaign:
    return WatchedCampaign(toycar, "small", tmp_path, choices=Choices(), workers=1, engine=None)


def test_a_finished_run_becomes_the_one_before(
    passes: WatchedCampaign, toycar: Workspace, tmp_path: Path, write_finished: Callable[..., Path]
) -> None:
    write_finished(toycar, tmp_path / "before")
    digest = RunFolder.open(write_finished(toycar, tmp_path / "now", limit=4)).head.plan
    passes.make_room()
    assert not passes.run_path.exists()
    assert RunFolder.open(tmp_path / "before").head.plan == digest


def test_the_rest_of_a_deleted_run_is_an_error_that_names_it(
    passes: WatchedCampaign, toycar: Workspace, tmp_path: Path, write_finished: Callable[..., Path]
) -> None:
    """A kill can leave it. Nothing that is not known to be a run is deleted."""
    write_finished(toycar, tmp_path / "now")
    (tmp_path / "before" / "plan").mkdir(parents=True)
    with pytest.raises(MutatorError, match=r"the rest of a run.*delete this folder"):
        passes.make_room()
    assert (tmp_path / "before" / "plan").exists()
