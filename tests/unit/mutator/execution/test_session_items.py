"""Sessions as items of pytest."""

from dataclasses import replace

import pytest

from mutator.execution.session_items import options_of_workspace
from mutator.workspace import Workspace


def test_a_replay_finds_what_the_project_settings_name(
    toy: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No command reads these settings, and none needs an option for what it finds by itself."""
    root = toy.library.parent
    for name in ("ROOT", "LIBRARY", "TEMPLATES", "TARGET"):
        monkeypatch.delenv(f"MUTATOR_{name}", raising=False)
    monkeypatch.chdir(root)
    assert options_of_workspace(Workspace.find()) == ()
    library, target = root / "faults", root / "src"
    (root / "fault_library").rename(library)
    target.mkdir()
    named = Workspace.find(library=library, target=target)
    assert options_of_workspace(named) == ("--library", str(library), "--target", str(target))
    assert options_of_workspace(replace(named, sandbox=True))[-1] == "--sandbox"
