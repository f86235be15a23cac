"""Errors that mean that the machine has run out of a resource."""

import errno
import os

import pytest

from mutator._common.resource_shortages import find_shortage
from mutator.errors import EXIT_HARNESS_ERRORS


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (MemoryError(), "no memory left"),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), "no memory left"),
        (ImportError("libx.so: failed to map segment from shared object"), "no memory left"),
        (OSError(errno.EMFILE, os.strerror(errno.EMFILE)), "too many open files"),
        (ImportError(f"libx.so: {os.strerror(errno.EMFILE)}"), "too many open files"),
        (BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable"), "no more processes"),
        (RuntimeError("can't start new thread"), "no more processes"),
    ],
)
def test_each_shortage_has_a_remedy(error: Exception, said: str) -> None:
    found = find_shortage(error)
    assert found is not None
    assert said in str(found)
    assert "the same command again" in str(found)
    assert found.exit_code == EXIT_HARNESS_ERRORS
    later = ValueError("x")
    later.__cause__ = error
    assert str(find_shortage(later)) == str(found)


@pytest.mark.parametrize(
    "error", [ValueError("x"), ImportError("No module named 'x'"), OSError(errno.ENOENT, "")]
)
def test_other_errors_are_not_shortages(error: Exception) -> None:
    assert find_shortage(error) is None
