"""Distributing work in the way of another package."""

from pathlib import Path

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.execution.distributor_choice import choose_distributor, packages_of_distributor
from mutator.execution.local_distributor import LocalDistributor
from mutator.workspace import Workspace

TWO = mutator.Choices(only='fault_type == "lane"', limit=2)


def test_a_distributor_of_another_package_runs_a_campaign(
    toycar: Workspace, tmp_path: Path, door_examples: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from door_examples.here import Here

    used: list[Here] = []
    run = Here.run
    monkeypatch.setattr(Here, "run", lambda self, session: (used.append(self), run(self, session)))
    ran = mutator.run("small", tmp_path / "a", choices=TWO, cluster="here:", workspace=toycar)
    assert ran.summary is not None
    assert (len(used), ran.summary.ran) == (1, 2)
    assert packages_of_distributor(choose_distributor("here:")) == ("door-examples",)


def test_without_a_cluster_work_stays_on_this_machine() -> None:
    assert isinstance(choose_distributor(), LocalDistributor)


@pytest.mark.parametrize("where", ["here:", "nowhere"])
def test_a_distributor_that_is_not_installed_is_a_wrong_cluster(where: str) -> None:
    with pytest.raises(MutatorError, match="cluster: '"):
        choose_distributor(where)


def test_a_distributor_checks_where(door_examples: Path) -> None:
    with pytest.raises(MutatorError, match="'here:there'"):
        choose_distributor("here:there")
