"""What `import mutator` offers."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import mutator

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "api.md"


def test_every_public_name_is_there() -> None:
    """Each name of `__all__` can be had, has a docstring and is shown by `dir`; no other one is offered."""
    assert list(mutator.__all__) == sorted(mutator.__all__, key=lambda n: (n.lower() == n, n))
    for name in mutator.__all__:
        assert getattr(mutator, name).__doc__, name
        assert name in dir(mutator)
    with pytest.raises(AttributeError, match="no attribute 'load_runs'"):
        mutator.load_runs  # noqa: B018


def test_the_import_is_light() -> None:
    """`import mutator` loads nothing heavy: what a name needs is loaded with that name."""
    code = "import mutator, sys; dir(mutator); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.partition(".")[0] for name in done.stdout.split()}
    assert not loaded & {"pandas", "numpy", "libcst", "pytest", "pydantic", "matplotlib", "yaml"}


def test_the_page_describes_every_public_name() -> None:
    """The reference has each name of `__all__`, as code, and calls nothing public that is not."""
    text = PAGE.read_text(encoding="utf-8")
    described = set(re.findall(r"^\| `(?:mutator\.)?(\w+)", text, re.MULTILINE))
    described |= set(re.findall(r"^## `(\w+)`", text, re.MULTILINE))
    assert described >= set(mutator.__all__)
    assert set(re.findall(r"`mutator\.(\w+)", text)) <= set(mutator.__all__)
