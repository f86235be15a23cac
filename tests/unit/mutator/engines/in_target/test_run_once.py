"""What the process of a run reports about its modules, its end and its probe."""

import errno
import os
import shutil
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.engines.in_target.run_once import (
    call_at_first_activation,
    collect_probe_report,
    describe_failure,
    modules_imported_since,
)

TREE = "/tree"
CODE = {
    "/tree/a.py": """
def deep():
    raise KeyError("deep")


def wrap():
    try:
        deep()
    except KeyError:
        raise ValueError("wrapped") from None


def several():
    try:
        deep()
    except KeyError as error:
        raise ExceptionGroup("several", [error, OSError(28, "full")])


def again(n):
    return again(n - 1) if n else deep()


def unspeakable():
    class Mute(Exception):
        def __str__(self):
            raise RuntimeError

    raise Mute


def interrupting():
    class Loud(Exception):
        def __str__(self):
            raise KeyboardInterrupt

    raise Loud


def stop():
    raise StepLimit("more than 3 steps")


class StepLimit(RuntimeError):
    __module__ = "car._fi"
""",
    "/elsewhere/b.py": "def outside(call):\n    call()\n",
}


def test_modules_imported_after_a_given_module_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("early", "_fi", "late"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    assert modules_imported_since("_fi") == ["late", "_fi"]
    monkeypatch.delitem(sys.modules, "early")
    monkeypatch.setitem(sys.modules, "early", types.ModuleType("early"))
    assert modules_imported_since("_fi") == ["early", "late", "_fi"]


def test_without_the_probe_all_modules_are_listed() -> None:
    assert set(modules_imported_since("never.imported")) == set(sys.modules)


@pytest.fixture
def described() -> Callable[..., dict[str, Any]]:
    """Call a function of the tree from outside, and describe how the run ends."""
    names: dict[str, Any] = {}
    for file, text in CODE.items():
        exec(compile(text, file, "exec"), names)

    def describe_call(name: str, *arguments: object) -> dict[str, Any]:
        try:
            names["outside"](lambda: names[name](*arguments))
        except BaseException as err:
            return describe_failure(err, TREE, "car._fi")
        raise AssertionError

    return describe_call


@pytest.mark.parametrize(
    ("name", "arguments", "kind", "message", "stacks"),
    [
        ("deep", (), "KeyError", "'deep'", [[("a.py", 3)]]),
        ("wrap", (), "ValueError", "wrapped", [[("a.py", 10)], [("a.py", 3), ("a.py", 8)]]),
        ("again", (50,), "KeyError", "'deep'", [[("a.py", 3), ("a.py", 21)]]),
        ("unspeakable", (), "Mute", "its text cannot be told (RuntimeError)", [[("a.py", 29)]]),
        ("interrupting", (), "Loud", "its text cannot be told (KeyboardInterrupt)", [[("a.py", 37)]]),
    ],
)
def test_exceptions_are_described_with_place_and_causes(
    described: Callable[..., dict[str, Any]],
    name: str,
    arguments: tuple[object, ...],
    kind: str,
    message: str,
    stacks: list[list[tuple[str, int]]],
) -> None:
    """Each line of the tree that an exception passed through is listed once, innermost first."""
    found = described(name, *arguments)
    assert found["ended"] == "error"
    error = found["error"]
    assert (error["kind"], error["message"]) == (kind, message)
    assert [[at[:2] for at in stack] for stack in error["stacks"]] == stacks


def test_members_of_an_exception_group_are_examined(described: Callable[..., dict[str, Any]]) -> None:
    error = described("several")["error"]
    assert error["kind"] == "ExceptionGroup"
    assert [("a.py", 3), ("a.py", 15)] in [[at[:2] for at in stack] for stack in error["stacks"]]


def test_the_probes_limit_exception_is_reported_as_the_step_limit(
    described: Callable[..., dict[str, Any]],
) -> None:
    assert described("stop") == {"ended": "steps"}


FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize(
    ("error", "is_told"),
    [
        (OSError(errno.ENOSPC, "full"), True),
        (shutil.Error([("from", "to", str(FULL))]), True),
        (OSError(errno.EACCES, "no"), False),
    ],
)
def test_a_full_disk_is_recognized_in_errors_and_their_causes(error: Exception, is_told: bool) -> None:
    assert describe_failure(error, TREE, None)["disk_full"] is is_told
    later = ValueError("later")
    later.__cause__ = KeyError("x")
    later.__cause__.__cause__ = later
    assert not describe_failure(later, TREE, None)["disk_full"]
    later.__cause__.__context__ = error
    assert describe_failure(later, TREE, None)["disk_full"] is is_told


def test_a_full_disk_in_an_exception_group_is_recognized(described: Callable[..., dict[str, Any]]) -> None:
    assert described("several")["disk_full"]
    assert not described("unspeakable")["disk_full"]


def test_the_first_activation_is_noted_once(tmp_path: Path) -> None:
    inactive = tmp_path / "inactive"
    inactive.touch()
    answers = [False, False, True, False]
    original = lambda fi: answers.pop(0)  # noqa: E731
    probe = types.SimpleNamespace(active=original)
    call_at_first_activation(probe, inactive.unlink)
    for active, there in ((False, True), (False, True), (True, False)):
        assert probe.active("a") is active
        assert inactive.exists() is there
    assert probe.active is original


def test_the_probes_report_is_passed_on() -> None:
    probe = types.SimpleNamespace(report=lambda: {"mutant": "m"})
    assert collect_probe_report(probe, TREE, "car._fi") == {"probe": {"mutant": "m"}}
    probe.report = lambda: object()
    assert not isinstance(collect_probe_report(probe, TREE, "car._fi")["probe"], dict)
    probe.report = lambda: 1 / 0
    told = collect_probe_report(probe, TREE, "car._fi")
    assert (told["probe"], told["ended"], told["error"]["kind"]) == (None, "error", "ZeroDivisionError")
