"""Pages that lead through the code name only what exists."""

import ast
import re
from pathlib import Path

import pytest

CLONE = Path(__file__).parents[2]
PAGES = ("an-hour-in-the-code.md", "vocabulary.md")
NAME_PATTERN = re.compile(r"`((?:mutator|selfdrive)(?:\.\w+)+)`")
ROOTS = {"mutator": CLONE, "selfdrive": CLONE / "target"}


def exists(name: str) -> bool:
    """Whether a dotted name is a module, or a definition in one."""
    path, parts = ROOTS[name.partition(".")[0]], name.split(".")
    while parts and (path / parts[0]).is_dir():
        path /= parts.pop(0)
    if parts and (path / f"{parts[0]}.py").is_file():
        path = path / f"{parts.pop(0)}.py"
    scope: ast.AST = ast.parse((path / "__init__.py" if path.is_dir() else path).read_text(encoding="utf-8"))
    for part in parts:
        definitions = [n for n in ast.iter_child_nodes(scope) if getattr(n, "name", None) == part]
        if not definitions:
            return False
        scope = definitions[0]
    return True


@pytest.mark.parametrize("page", PAGES)
def test_every_name_on_the_page_exists(page: str) -> None:
    names = NAME_PATTERN.findall((CLONE / "docs" / "explanation" / page).read_text(encoding="utf-8"))
    assert len(names) > 20
    assert [name for name in names if not exists(name)] == []


def test_names_that_do_not_exist_are_reported() -> None:
    assert exists("mutator.errors.MutatorError")
    assert not exists("mutator.errors.NoSuchError")
    assert not exists("mutator.nowhere")
