"""What the tests of sessions share."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator.execution.session_summary import Summary
from mutator.workspace import Workspace


@pytest.fixture
def run(toycar: Workspace, tmp_path: Path) -> Callable[..., Summary]:
    """Run the campaign `small` without the store of finished runs."""

    def ran(name: str, **arguments: Any) -> Summary:
        if arguments.get("since") is None:
            arguments["reuse"] = False
        summary = mutator.run("small", tmp_path / name, workspace=toycar, engine="fork", **arguments).summary
        assert summary is not None
        return summary

    return ran
