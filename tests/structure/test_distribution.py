"""The name of the distribution, and the files that repeat what pyproject.toml says."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from mutator._common.version import DISTRIBUTION, VERSION

CLONE = Path(__file__).parents[2]
PROJECT = tomllib.loads((CLONE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
FOLDERS = ("mutator", "docs", "examples", "fault_library", "templates", "benchmarks")
SUFFIXES = {".md", ".py", ".j2", ".yaml", ".html", ".ipynb", ".txt"}
# The package called mutator on the package index is another project.
STRANGERS_PACKAGE = re.compile(
    r"\b(?:pip|pipx|uv) (?:[^\n`]* )?(?:install|add)\b[^\n`]*(?<![\w/.-])mutator(?=[\s'\"\[=<>~`]|$)"
)


def texts() -> Iterator[Path]:
    yield from (path for path in CLONE.iterdir() if path.is_file() and path.suffix in SUFFIXES)
    for folder in FOLDERS:
        yield from (path for path in (CLONE / folder).rglob("*") if path.suffix in SUFFIXES)


def test_the_harness_knows_the_name_under_which_pip_installs_it() -> None:
    assert PROJECT["name"] == DISTRIBUTION != "mutator"
    assert PROJECT["scripts"].keys() == {"mutator"}


def test_an_extra_includes_extras_by_that_name() -> None:
    lines = [line for extra in PROJECT["optional-dependencies"].values() for line in extra]
    including = [r for r in map(Requirement, lines) if r.extras and "mutator" in r.name]
    assert {canonicalize_name(requirement.name) for requirement in including} == {DISTRIBUTION}


def test_nothing_tells_people_to_install_a_strangers_package() -> None:
    lines = [
        f"{path.relative_to(CLONE)}: {found[0]}"
        for path in texts()
        if (found := STRANGERS_PACKAGE.search(path.read_text(encoding="utf-8")))
    ]
    assert lines == []


@pytest.mark.parametrize(
    "command", ["pip install mutator", "pip install 'mutator[dev]'", "uv add mutator==1"]
)
def test_the_pattern_finds_such_a_command(command: str) -> None:
    assert STRANGERS_PACKAGE.search(command)
    assert not STRANGERS_PACKAGE.search("pip install dist/mutator_fi-0.1.0.whl && .venv/bin/mutator list")
    assert not STRANGERS_PACKAGE.search("pip install 'mutator-fi[dev]'")


def test_the_citation_repeats_the_project() -> None:
    """The keys that CFF 1.2.0 requires are there, and what pyproject.toml says is said the same way."""
    citation = yaml.safe_load((CLONE / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0" and citation["message"] and citation["type"] == "software"
    assert citation["title"] == f"mutator: {PROJECT['description']}"
    assert (citation["version"], citation["license"]) == (VERSION, PROJECT["license"])
    assert citation["authors"] == PROJECT["authors"]
    assert citation["keywords"] == PROJECT["keywords"]
