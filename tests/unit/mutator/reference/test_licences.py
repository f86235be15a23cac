"""The page of licences lists every dependency with the licence that its package states."""

import hashlib
import sys
from email.message import Message
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.reference.licences import (
    PAGE_PATH,
    UPLOT_FOLDER,
    licence_by_package_in,
    packages_in_constraints,
    stated_licence,
    uplot_version,
    write_licences,
)

CLONE = Path(__file__).parents[4]
TABLE = licence_by_package_in((CLONE / PAGE_PATH).read_text(encoding="utf-8"))


def test_every_constrained_package_has_a_licence() -> None:
    assert tuple(TABLE) == packages_in_constraints(CLONE)
    assert all(licence.strip() for licence in TABLE.values())


@pytest.mark.skipif(sys.version_info[:2] != (3, 11), reason="the page has the versions for Python 3.11")
def test_the_licences_are_those_that_the_packages_state() -> None:
    stated = {name: stated_licence(name) for name in TABLE}
    installed = {name: licence for name, licence in stated.items() if licence is not None}
    assert "numpy" in installed
    assert {name: TABLE[name] for name in installed} == installed


def test_a_licence_text_is_listed_by_its_first_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """Some packages put the whole text of their licence into the name field."""
    stated = Message()
    stated["License"] = "BSD 3-Clause License\n \n Redistribution and use ..."
    monkeypatch.setattr("mutator.reference.licences.metadata.metadata", lambda name: stated)
    assert stated_licence("any") == "BSD 3-Clause License"


def clone(folder: Path, *packages: str) -> Path:
    (folder / "docs" / "reference").mkdir(parents=True, exist_ok=True)
    (folder / "constraints.txt").write_text("".join(f"{name}==1\n" for name in ("# made by", *packages)))
    (folder / "pyproject.toml").write_text(
        '[project]\ndependencies = ["pytest>=8"]\noptional-dependencies.test = ["no_such>=1", "pytest"]\n'
    )
    return folder


def test_a_package_that_is_not_installed_keeps_its_licence(tmp_path: Path) -> None:
    page = clone(tmp_path, "pytest", "no_such") / PAGE_PATH
    page.write_text("| gone | others | MIT |\n| no_such | others | BSD |\n")
    write_licences(tmp_path)
    assert licence_by_package_in(page.read_text()) == {"no_such": "BSD", "pytest": "MIT"}
    assert "| no_such | `test` | BSD |" in page.read_text()
    assert "| pytest | mutator | MIT |" in page.read_text()
    with pytest.raises(MutatorError, match="no known licence for another; install another"):
        write_licences(clone(tmp_path, "another"))


def test_the_page_has_the_licence_and_version_of_vendored_code() -> None:
    page = (CLONE / PAGE_PATH).read_text(encoding="utf-8")
    assert uplot_version(CLONE) == "1.6.32"
    assert "uPlot](https://github.com/leeoniya/uPlot) 1.6.32 by Leon Sorokin" in page
    licence = (CLONE / UPLOT_FOLDER / "LICENSE").read_text(encoding="utf-8")
    assert all(f"> {line}".rstrip() in page for line in licence.splitlines())


def test_vendored_code_is_as_its_authors_published_it() -> None:
    """The digests are those of the files of npm's package uplot 1.6.32."""
    digests = {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in (CLONE / UPLOT_FOLDER).iterdir()
    }
    assert digests == {
        "LICENSE": "8f989229699b4fe2f1a0432d0e9edc338a8a911e250e2d1b01ecd770a5f5b1bd",
        "uPlot.iife.min.js": "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f",
        "uPlot.min.css": "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
    }
