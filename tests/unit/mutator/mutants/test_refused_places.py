"""Places that cannot be hit are refused where they are listed, checked and tried."""

from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.workspace import Workspace
from tests.small_loop import small_loop

CONTROL = """
class Control:
    def update(self, y, dt):
        return law(y)
"""
NUMBA = {"numba/__init__.py": "def njit(f):\n    return f\n"}
JITTED = (
    "from numba import njit\nGAIN = -2.0\n@njit\ndef law(y, by=1.0):\n    return GAIN * y * by\n" + CONTROL
)
AT_LAW = "{file: law.py, function: law, return_value: GAIN * y * by}"


def jitted(folder: Path, manifest: str = "", **places: str) -> Workspace:
    return small_loop(folder, {"law.py": JITTED, **NUMBA}, manifest=manifest, **places)


@pytest.mark.parametrize(
    ("at", "reason"),
    [
        (AT_LAW, "law is compiled by numba.njit"),
        ("{file: law.py, function: law, default: by}", "law is compiled by numba.njit"),
        ("{file: law.py, constant: GAIN}", "only functions compiled by numba.njit read it"),
    ],
)
def test_a_place_in_a_compiled_function_is_refused(tmp_path: Path, at: str, reason: str) -> None:
    """`check` and `try` name the compiler, the line and the variable that turns it off."""
    workspace = jitted(tmp_path, one=at)
    (problem,) = mutator.check_library(workspace)
    assert reason in str(problem) and "law.py:" in str(problem)
    with pytest.raises(MutatorError, match=r"compiled by numba.njit.*add `NUMBA_DISABLE_JIT: '1'` to `env`"):
        mutator.try_fault("c/f/one", "s", workspace=workspace)


def test_a_compiled_function_is_not_offered(tmp_path: Path) -> None:
    """`places` lists none of its places, and says why."""
    workspace = jitted(tmp_path)
    assert {place.location.function for place in mutator.find_places("law.py", workspace)} == {
        "Control.update"
    }
    assert [
        (note.line, note.what, note.reason) for note in mutator.find_place_notes("law.py", workspace)
    ] == [
        (2, "GAIN", "only functions compiled by numba.njit read it, and they keep its first value"),
        (4, "law", "law is compiled by numba.njit"),
    ]


def test_a_compiler_that_is_turned_off_hides_nothing(tmp_path: Path) -> None:
    """With the variable in `env` of the manifest, every place is offered."""
    workspace = jitted(tmp_path, "env: {NUMBA_DISABLE_JIT: '1'}\n", one=AT_LAW)
    assert not mutator.check_library(workspace)
    assert not mutator.find_place_notes("law.py", workspace)


@pytest.mark.parametrize("shadow", [f"pkg/gain{EXTENSION_SUFFIXES[0]}", "pkg/gain/__init__.py"])
def test_a_file_that_another_shadows_is_refused(tmp_path: Path, shadow: str) -> None:
    """Python imports a package or an extension module before a file of the same name."""
    files = {"law.py": "from pkg.gain import law\n" + CONTROL, "pkg/__init__.py": "", shadow: ""}
    files["pkg/gain.py"] = "def law(y):\n    return y\n"
    workspace = small_loop(tmp_path, files, one="{file: pkg/gain.py, function: law, return_value: y}")
    (problem,) = mutator.check_library(workspace)
    assert f"{shadow}, beside pkg/gain.py, is imported in its place" in str(problem)


def test_a_field_whose_class_copies_it_is_refused(tmp_path: Path) -> None:
    """A model of pydantic keeps its default elsewhere; the message names the base, also of another file."""
    files = {
        "pydantic/__init__.py": "class BaseModel:\n    pass\n",
        "base.py": "from pydantic import BaseModel\nclass Base(BaseModel):\n    pass\n",
        "law.py": "from base import Base\nclass Settings(Base):\n    gain: float = -2.0\n" + CONTROL,
    }
    workspace = small_loop(tmp_path, files, one="{file: law.py, constant: Settings.gain}")
    assert "its class derives from BaseModel of pydantic" in str(mutator.check_library(workspace)[0])
    (note,) = mutator.find_place_notes("law.py", workspace)
    assert (note.line, note.what) == (3, "Settings.gain")
