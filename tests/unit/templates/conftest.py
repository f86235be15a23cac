"""What the tests of the effects of fault models share."""

import pytest

from mutator.model import Anchor, AnchorKind, Value
from mutator.workspace import Workspace
from tests.unit.templates.function_with_fault import Make, Toy


@pytest.fixture
def toy(clone: Workspace) -> Make:
    def make(source: str, kind: AnchorKind, name: str, model: str, /, **params: Value) -> Toy:
        return Toy(clone, source, Anchor(kind=kind, name=name), model, **params)

    return make
