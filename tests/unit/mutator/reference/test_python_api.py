"""The page of the Python API documents every public name."""

import re
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

import mutator
from mutator.reference.python_api import list_undocumented, members_of, render_api_page
from mutator.workspace import Workspace

CLONE = Path(__file__).parents[4]


def test_every_public_name_is_documented() -> None:
    """An attribute is described by a `#:` comment."""
    assert list_undocumented() == []


def test_the_page_describes_every_public_name() -> None:
    """The version is left out, because it is a plain string."""
    page = render_api_page(Workspace.find(CLONE))
    headings = re.findall(r"^### (?:mutator\.)?(\w+)$", page, re.MULTILINE)
    assert sorted(headings) == sorted(set(mutator.__all__) - {"__version__"})


def test_a_missing_docstring_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "silent.py").write_text(
        "class Silent:\n"
        "    said: int = 0  #: said\n"
        "    #: said on\n"
        "    #: two lines\n"
        "    above: int = 1\n"
        "    unsaid: int = 2\n"
        "    _private: int = 3\n"
        "    def __init__(self, own: str):\n"
        "        self.own = own\n"
        "    def method(self, n: int = 3) -> 'Silent': ...\n"
        "    @property\n"
        "    def of_it(self) -> int: ...\n"
        "def silent() -> None: ...\n"
    )
    spec = spec_from_file_location("mutator.silent", tmp_path / "silent.py")
    assert spec and spec.loader
    module = module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, module)
    spec.loader.exec_module(module)
    monkeypatch.setattr(mutator, "__all__", ["Silent", "silent"])
    for name in mutator.__all__:
        monkeypatch.setattr(mutator, name, getattr(module, name), raising=False)
    assert list_undocumented() == [
        "silent",
        "Silent",
        "Silent.unsaid",
        "Silent.own",
        "Silent.method",
        "Silent.of_it",
    ]
    found = {
        member.name: (member.signature, member.type, member.meaning) for member in members_of(module.Silent)
    }
    assert found["above"] == ("above", "int", "Said on two lines.")
    assert found["method"] == ("method(n=3)", "Silent", "")
