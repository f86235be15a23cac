"""The public names of `mutator`."""

import subprocess
import sys

import pytest

import mutator


def test_every_public_name_can_be_imported() -> None:
    assert list(mutator.__all__) == sorted(mutator.__all__, key=lambda n: (n.lower() == n, n))
    for name in mutator.__all__:
        assert getattr(mutator, name).__doc__, name
        assert name in dir(mutator)
    with pytest.raises(AttributeError, match="no attribute 'load_runs'"):
        mutator.load_runs  # noqa: B018


def test_importing_mutator_loads_no_slow_packages() -> None:
    code = "import mutator, sys; dir(mutator); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.partition(".")[0] for name in done.stdout.split()}
    assert not loaded & {"pandas", "numpy", "libcst", "pytest", "pydantic", "matplotlib", "yaml"}
