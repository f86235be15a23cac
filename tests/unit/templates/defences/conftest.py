"""Models of defences, loaded as a target loads them: each from its file, without the harness."""

import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

MODELS = Path(__file__).parents[4] / "templates" / "defences"


@pytest.fixture
def model(request: pytest.FixtureRequest) -> Callable[..., Any]:
    """Build the model that the test module names: `test_limit.py` tests `limit.py`."""
    name = request.path.stem.removeprefix("test_")

    def build(**parameters: float) -> Any:
        built = runpy.run_path(str(MODELS / f"{name}.py"))["Model"](**parameters)
        built.reset()
        return built

    return build
