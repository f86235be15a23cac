"""What the tests of the effects of fault models share."""

import pytest

from mutator.model import Anchor, AnchorKind, Value
from mutator.workspace import Workspace
from tests.unit.templates.function_with_fault import FaultyFunction, WithFault


@pytest.fixture
def with_fault(clone: Workspace) -> WithFault:
    def make(source: str, kind: AnchorKind, name: str, model: str, /, **params: Value) -> FaultyFunction:
        return FaultyFunction(clone, source, Anchor(kind=kind, name=name), model, **params)

    return make
