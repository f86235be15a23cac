"""Stretches of work."""

from dataclasses import asdict
from typing import Any

import pytest

from mutator.errors import MutatorError
from mutator.store.stretches import Stretch, differences, package_versions, read_stretches, told

BEFORE = Stretch(
    python="CPython 3.11.7",
    packages={"numpy": "1.26.4", "old": "1.0"},
    platform="Linux-6.1",
    cpu="Cray 1",
    blas=[{"library": "openblas", "version": "0.3", "kernel": "Haswell", "threads": 1}],
    git={"library": {"commit": "abc", "changed": True}},
)


def test_stretches_are_read_as_written() -> None:
    assert read_stretches({"stretches": [asdict(BEFORE)]}) == (BEFORE,)


@pytest.mark.parametrize("stretch", [{}, {"python": "3"}, asdict(BEFORE) | {"stranger": 1}, 7])
def test_a_damaged_stretch_is_reported(stretch: Any) -> None:
    with pytest.raises(MutatorError, match=r"run\.json: a damaged stretch of work"):
        read_stretches({"stretches": [stretch]})


def test_every_difference_is_named() -> None:
    packages = {"numpy": "2.1.0", "old": None, "new": "3.0"}
    assert differences(BEFORE, "CPython 3.12.1", packages) == (
        "CPython 3.11.7, here CPython 3.12.1",
        "new none, here 3.0",
        "numpy 1.26.4, here 2.1.0",
        "old 1.0, here none",
    )
    assert differences(BEFORE, BEFORE.python, BEFORE.packages | {"unused": None}) == ()


def test_several_stretches_are_printed_together() -> None:
    after = Stretch(
        python="CPython 3.12.1",
        packages={"numpy": "2.1.0"},
        platform="Linux-6.1",
        accepted=("numpy 1.26.4, here 2.1.0",),
    )
    assert told([BEFORE, after, after]) == {
        "python": "CPython 3.11.7, CPython 3.12.1",
        "platform": "Linux-6.1",
        "processor": "Cray 1",
        "BLAS": "openblas 0.3 (Haswell), threads: 1",
        "git commit of library": "abc with changes",
        "other versions accepted": "numpy 1.26.4, here 2.1.0",
    }
    assert package_versions([BEFORE, after]) == {"numpy": "1.26.4, 2.1.0", "old": "1.0"}
