"""What forks report of crashes."""

import pytest

from mutator.engines.in_target.crash_description import describe_crash, is_independent_of_process


@pytest.mark.parametrize(
    "error",
    [
        *(RecursionError(), MemoryError(), OSError(), FileNotFoundError(), TimeoutError(), ImportError()),
        *(ModuleNotFoundError(), SystemError(), SystemExit(1), KeyboardInterrupt(), GeneratorExit()),
    ],
    ids=repr,
)
def test_an_exception_about_the_process_is_not_described(error: BaseException) -> None:
    """The reference engine must run it, even if it is only the cause of another exception."""
    assert not is_independent_of_process(error)
    assert describe_crash([error], [[]], []) is None
    assert describe_crash([ValueError(), error], [[], []], []) is None


@pytest.mark.parametrize("error", [ValueError(), TypeError(), KeyError(), AssertionError()])
def test_an_exception_of_the_code_is_described(error: Exception) -> None:
    crash = describe_crash([error], [[]], [])
    assert crash == {"classes": [f"builtins.{type(error).__name__}"], "frames": [[]]}


def test_frames_say_whether_the_mutant_changed_their_code() -> None:
    """Functions inside a changed one are new, too, and equal code of another function is not."""
    source = "def f():\n    return [lambda: 1]\n"
    new, old = (compile(source, "a.py", "exec").co_consts[0] for _ in range(2))
    inner = new.co_consts[1]
    assert new == old
    frames = [("a.py", 2, 4, inner), ("a.py", 1, 0, new), ("a.py", 1, 0, old)]
    crash = describe_crash([ValueError()], [frames], [new])
    assert crash is not None
    assert crash["frames"] == [[("a.py", 2, 4, True), ("a.py", 1, 0, True), ("a.py", 1, 0, False)]]
