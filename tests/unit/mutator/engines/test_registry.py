"""The list of engines, and how a campaign's engine is chosen."""

from pkgutil import resolve_name

import pytest

from mutator.engines.kinds import ENGINES, FORK, REFERENCE
from mutator.engines.registry import choose_engine
from mutator.errors import MutatorError
from mutator.workspace import Workspace


def test_each_engine_can_be_made() -> None:
    """Every engine in the list has a working factory and is listed under its own name."""
    for name, kind in ENGINES.items():
        assert kind.name == name and kind.about
        assert callable(resolve_name(kind.factory))


def test_the_default_is_the_fastest_that_pays(toycar: Workspace) -> None:
    """A small campaign uses the reference engine and a large one the fork engine. An unknown name is
    refused."""
    manifest = toycar.manifest("toycar")
    assert choose_engine(None, manifest, 3) == REFERENCE
    assert choose_engine(None, manifest, 1000) == FORK
    with pytest.raises(MutatorError, match="engine 'quick'; expected one of reference, warm, fork"):
        choose_engine("quick", manifest, 3)
