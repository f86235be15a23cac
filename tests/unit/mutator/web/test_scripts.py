"""The unit tests of the pages' scripts are JavaScript, which node runs."""

import shutil
import subprocess
from pathlib import Path

import pytest

from mutator import web

NODE = shutil.which("node")
CLONE = Path(__file__).parents[4]


@pytest.mark.skipif(NODE is None, reason="needs Node.js")
def test_scripts_pass_their_unit_tests() -> None:
    tests = sorted(Path(__file__).parent.glob("*.test.mjs"))
    done = subprocess.run(
        [str(NODE), "--test", *map(str, tests)], capture_output=True, text=True, timeout=120
    )
    assert tests and done.returncode == 0, done.stdout


@pytest.mark.parametrize("name", [name for name in web.asset_names(".js") if not name.startswith("uplot/")])
def test_every_script_is_checked(name: str) -> None:
    """Editors check a script with this first line, as `tox -e lint` does."""
    assert web.asset_text(name).startswith('// @ts-check\n"use strict";\n')


def test_development_packages_are_pinned_without_the_address_of_a_registry() -> None:
    """`npm ci` installs them from whatever registry is configured."""
    lock = (CLONE / "package-lock.json").read_text(encoding="utf-8")
    assert '"resolved"' not in lock
    assert lock.count('"integrity"') > 50
