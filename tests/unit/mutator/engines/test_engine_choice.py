"""The list of engines, and how a campaign's engine is chosen."""

from pkgutil import resolve_name

import pytest

from mutator.engines.engine_choice import check_engine_is_offered, choose_engine
from mutator.engines.engine_kinds import ENGINES, FORK
from mutator.errors import MutatorError
from mutator.workspace import Workspace


def test_each_listed_engine_has_a_description_and_a_factory() -> None:
    for name, kind in ENGINES.items():
        assert kind.name == name and kind.about
        assert callable(resolve_name(kind.factory))


def test_the_default_engine_depends_on_the_size_of_the_campaign(toycar: Workspace) -> None:
    manifest = toycar.manifest("toycar")
    assert choose_engine(None, manifest) == FORK
    with pytest.raises(MutatorError, match="no engine 'quick'; expected one of reference, fork"):
        choose_engine("quick", manifest)


@pytest.mark.parametrize("name", ["warm", "quick", ""])
def test_users_choose_among_the_offered_engines(name: str) -> None:
    check_engine_is_offered(None)
    check_engine_is_offered(FORK)
    with pytest.raises(MutatorError, match=f"engine: no engine '{name}'; expected one of reference, fork"):
        check_engine_is_offered(name)
