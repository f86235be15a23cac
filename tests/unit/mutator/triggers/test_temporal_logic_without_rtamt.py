"""What happens to formulas of signal temporal logic where rtamt is missing."""

import sys

import pytest

from mutator.errors import MutatorError
from mutator.triggers.temporal_logic import check_stl_formula


def test_the_error_names_the_extra_and_the_pythons_that_rtamt_supports(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "rtamt", None)
    with pytest.raises(MutatorError, match=r"Python 3\.11 or 3\.12; pip install 'mutator-fi\[stl\]'"):
        check_stl_formula("always (x < 1)", ("x",), 0.01)
