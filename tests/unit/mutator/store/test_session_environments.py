"""Stretches of work."""

import json
from dataclasses import replace
from typing import Any

import pytest

from mutator._common.hashing import as_json_types
from mutator._common.typed_json import typed_value_from_json
from mutator.errors import TypeMisfit
from mutator.store.session_environments import (
    Blas,
    GitCloneState,
    SessionEnvironment,
    WorkerMachine,
    describe_environments,
    version_differences,
    version_texts_by_package,
)

BEFORE = SessionEnvironment(
    python="CPython 3.11.7",
    packages={"numpy": "1.26.4", "old": "1.0"},
    platform="Linux-6.1",
    cpu="Cray 1",
    blas=(Blas(library="openblas", version="0.3", kernel="Haswell", threads=1),),
    git={"library": GitCloneState(commit="abc", changed=True)},
)


def test_stretches_are_read_as_written() -> None:
    machine = WorkerMachine(
        worker="w", mutator="0.2", host="h", python="3", platform="p", cpu=None, blas=BEFORE.blas, packages={}
    )
    for stretch in (BEFORE, replace(BEFORE, machines=(machine,))):
        assert (
            typed_value_from_json(SessionEnvironment, json.loads(json.dumps(as_json_types(stretch))))
            == stretch
        )


@pytest.mark.parametrize(
    ("stretch", "got"),
    [
        ({}, "no key 'python'"),
        ({"python": "3"}, "no key 'packages'"),
        (as_json_types(BEFORE) | {"stranger": 1}, "an unknown key 'stranger'"),
        (7, "7"),
    ],
)
def test_a_damaged_stretch_is_refused(stretch: Any, got: str) -> None:
    with pytest.raises(TypeMisfit, match=got):
        typed_value_from_json(SessionEnvironment, stretch)


def test_every_difference_is_named() -> None:
    packages = {"numpy": "2.1.0", "old": None, "new": "3.0"}
    assert version_differences(BEFORE, "CPython 3.12.1", packages) == (
        "CPython 3.11.7, here CPython 3.12.1",
        "new none, here 3.0",
        "numpy 1.26.4, here 2.1.0",
        "old 1.0, here none",
    )
    assert version_differences(BEFORE, BEFORE.python, BEFORE.packages | {"unused": None}) == ()


def test_several_stretches_are_printed_together() -> None:
    after = SessionEnvironment(
        python="CPython 3.12.1",
        packages={"numpy": "2.1.0"},
        platform="Linux-6.1",
        accepted=("numpy 1.26.4, here 2.1.0",),
    )
    assert describe_environments([BEFORE, after, after]) == {
        "python": "CPython 3.11.7, CPython 3.12.1",
        "platform": "Linux-6.1",
        "processor": "Cray 1",
        "BLAS": "openblas 0.3 (Haswell), threads: 1",
        "git commit of library": "abc with changes",
        "other versions accepted": "numpy 1.26.4, here 2.1.0",
    }
    assert version_texts_by_package([BEFORE, after]) == {"numpy": "1.26.4, 2.1.0", "old": "1.0"}
