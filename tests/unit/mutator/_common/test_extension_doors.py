"""Doors: what is found by name, and what is refused."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from mutator._common import extension_doors
from mutator._common.extension_doors import ALL_DOORS, EXPORT_DOOR, Door
from mutator.errors import MutatorError

CLONE = Path(__file__).parents[4]
BROKEN = {
    "shape": ("THING = 3", "is of type int; expected a mutator.exports.Export"),
    "import": ("import no_such_module", "cannot be loaded: ModuleNotFoundError"),
    "missing": ("", "cannot be loaded: AttributeError"),
}


def project(folder: Path, name: str, source: str) -> Path:
    (folder / "strange_door.py").write_text(source)
    text = '[project]\nname = "strange"\nversion = "2.5"\n[project.entry-points."mutator.exports"]\n'
    (folder / "pyproject.toml").write_text(f'{text}{name} = "strange_door:THING"\n')
    return folder


@pytest.mark.parametrize("kind", BROKEN)
def test_a_broken_addition_is_an_error_that_names_its_package(
    kind: str, tmp_path: Path, install: Callable[[Path], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    source, words = BROKEN[kind]
    monkeypatch.delitem(sys.modules, "strange_door", raising=False)
    install(project(tmp_path, "strange", source))
    with pytest.raises(MutatorError, match=r"export 'strange' of package strange 2\.5") as error:
        EXPORT_DOOR.load("strange")
    monkeypatch.delitem(sys.modules, "strange_door", raising=False)
    assert words in str(error.value) and "uninstall this package" in str(error.value)


def test_a_name_that_two_packages_use_is_refused(tmp_path: Path, install: Callable[[Path], None]) -> None:
    install(project(tmp_path, "csv", "THING = 3"))
    with pytest.raises(MutatorError, match=r"comes from mutator and strange 2\.5"):
        EXPORT_DOOR.load("csv")


def test_an_unknown_name_lists_those_that_exist(door_examples: Path) -> None:
    with pytest.raises(MutatorError, match=r"no export 'cvs'.*csv.*counts"):
        EXPORT_DOOR.load("cvs")


def test_the_page_lists_every_door() -> None:
    assert {door for door in vars(extension_doors).values() if isinstance(door, Door)} == set(ALL_DOORS)
    page = (CLONE / "docs" / "reference" / "doors.md").read_text()
    for door in ALL_DOORS:
        assert f'[project.entry-points."{door.entry_point_group}"]' in page
        assert all(f"| `{name}` |" in page for name in door.shipped_names())


def test_no_other_module_looks_for_entry_points() -> None:
    folder = CLONE / "mutator"
    looking = [path for path in folder.rglob("*.py") if "entry_points(" in path.read_text()]
    # pytest loads the plugin; `local` asks only whether it will
    assert {str(path.relative_to(folder)) for path in looking} == {
        "_common/extension_doors.py",
        "execution/local_pytest_session.py",
    }


def test_the_command_line_starts_without_any_addition() -> None:
    parts = (".formats.", ".importers.", ".distributors.", ".operators.shipped.", "importlib.metadata")
    code = f"import sys, mutator.cli.app; print([m for m in sys.modules if any(p in m for p in {parts})])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_pages_say_what_other_packages_can_add_and_what_stays_of_them() -> None:
    pages = CLONE / "docs" / "reference"
    lines = [line for line in (pages / "cli.md").read_text().splitlines() if "--operators NAMES" in line]
    assert lines and all("Other packages can add operators." in line for line in lines)
    assert "its exports wrote in run folders are strangers" in (pages / "doors.md").read_text()
