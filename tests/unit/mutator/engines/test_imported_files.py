"""The files that an import loads are found by the names in compiled code."""

import pytest

from mutator.engines.imported_files import ModuleNames, files_imported_by, module_names_in

TREE = {
    "run.py": "import car.go\nfrom car import wheel as w\n",
    "car/__init__.py": "",
    "car/go.py": "from . import door\nfrom .parts.seat import Seat\nfrom ..car.horn import sound\n",
    "car/wheel.py": "def turn():\n    import lazy\n",
    "car/door.py": "try:\n    import fast\nexcept ImportError:\n    fast = None\n",
    "car/horn.py": "",
    "car/parts/__init__.py": "from car.parts import *\n",
    "car/parts/seat.py": "Seat = 1\n",
    "car/spare.py": "",
    "fast.py": "",
    "lazy.py": "",
    "other/door.py": "",
    "src/deep/tool.py": "",
    "tests/test_car.py": "import car.spare\n",
}
RUN_LOADS = {name for name in TREE if name.startswith("car/")} - {"car/spare.py"} | {"run.py", "fast.py"}


def reached(tree: dict[str, str], entry: str) -> set[str]:
    def names_of(path: str) -> ModuleNames:
        return module_names_in(compile(tree[path], path, "exec"))

    files = files_imported_by(tree, entry, names_of)
    assert len(files) == len(set(files))
    return set(files)


def test_modules_that_the_entry_module_imports_are_reached_in_turn_with_their_packages() -> None:
    """No import inside a function, and no other module, counts."""
    assert reached(TREE, "run") == RUN_LOADS


@pytest.mark.parametrize(
    ("line", "file"),
    [
        ("import deep.tool", "src/deep/tool.py"),
        ("from deep import tool", "src/deep/tool.py"),
        ("import importlib\nimportlib.import_module(f'car.{0}.tool')", "src/deep/tool.py"),
        ("def load(name):\n    return __import__('car.spare')", "car/spare.py"),
    ],
    ids=["another folder on the path", "without __init__", "by a computed name", "by name in a function"],
)
def test_ways_to_import_a_module(line: str, file: str) -> None:
    assert reached({**TREE, "run.py": line}, "run") >= {file}
    assert file not in RUN_LOADS


def test_an_entry_package_runs_its_main_module() -> None:
    tree = {**TREE, "car/__main__.py": "import fast", "car/go.py": ""}
    assert reached(tree, "car") == {"car/__init__.py", "car/__main__.py", "fast.py"}


def test_an_entry_module_outside_of_the_tree_reaches_nothing() -> None:
    assert not reached(TREE, "elsewhere")
