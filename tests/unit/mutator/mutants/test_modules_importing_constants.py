"""Modules that import a constant, which a fault must change there, too."""

from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.mutants.modules_importing_constants import dotted_names_importing_constant
from mutator.targets.source_tree import read_tree


def test_modules_that_import_a_constant_are_found(tmp_path: Path) -> None:
    files = {
        "pkg/__init__.py": "from .limits import LIMIT\n",
        "pkg/limits.py": "LIMIT = 5\n",
        "pkg/sub/a.py": "from ..limits import LIMIT as L\nfrom .. import limits\n",
        "pkg/sub/b.py": "from pkg import LIMIT\n\ndef f():\n    from pkg.limits import LIMIT\n",
        "other.py": "from limits import LIMIT\n",
    }
    for path, text in files.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    tree = read_tree(tmp_path, ["**"])
    assert sorted(dotted_names_importing_constant(tree, "pkg/limits.py", "LIMIT")) == [
        "pkg.LIMIT",
        "pkg.sub.a.L",
        "pkg.sub.b.LIMIT",
    ]


def test_imports_that_cannot_be_changed_are_listed(tmp_path: Path) -> None:
    texts = {
        "limits": "LIMIT = 5\n",
        "a": "from limits import *\n",
        "b": "class C:\n    from limits import LIMIT\n",
        "c": "from limits import LIMIT\nLIMIT += 1\n",
    }
    texts |= {"kept": "__all__ = ['other']\nLIMIT, other = 1, 2\n", "d": "from kept import *\n"}
    for name, text in texts.items():
        (tmp_path / f"{name}.py").write_text(text)
    assert dotted_names_importing_constant(read_tree(tmp_path, ["**"]), "kept.py", "LIMIT") == (), (
        "`*` does not include it"
    )
    words = "a.py:1 imports \\*; b.py:2 imports it into a class; c.py:1 imports it, and also sets LIMIT in"
    with pytest.raises(MutatorError, match=words):
        dotted_names_importing_constant(read_tree(tmp_path, ["**"]), "limits.py", "LIMIT")
