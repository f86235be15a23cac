"""What the process of a run tells of its modules."""

import sys
import types

import pytest

from mutator.engines.in_target.run_once import imported_since


def test_modules_since_one_was_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that came later, and the one itself; also one that was there before and is imported anew."""
    for name in ("early", "_fi", "late"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    assert imported_since("_fi") == ["late", "_fi"]
    monkeypatch.delitem(sys.modules, "early")
    monkeypatch.setitem(sys.modules, "early", types.ModuleType("early"))
    assert imported_since("_fi") == ["early", "late", "_fi"]


def test_a_module_that_never_came_hides_none() -> None:
    """Where the probe was not installed, all modules are looked at."""
    assert set(imported_since("never.imported")) == set(sys.modules)
