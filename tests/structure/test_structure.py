"""How the house is built: which package may import which, and what no module may do."""

import ast
import shutil
import subprocess
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

CLONE = Path(__file__).parents[2]
MUTATOR = CLONE / "mutator"
TOP_MODULES = 12
# may import the harness inside functions: they put off what a command does not need
LAZY = ("mutator/__init__.py", "mutator/cli/", "mutator/execution/pytest_plugin.py")

Imports = Iterator[tuple[str, str, bool]]


def modules() -> Iterator[Path]:
    yield from sorted(MUTATOR.rglob("*.py"))


def imports(path: Path) -> Imports:
    """(file, imported module, whether inside a function) of a module, below TYPE_CHECKING too."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    functions = [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)]
    inside = {node for function in functions for node in ast.walk(function)}
    file = path.relative_to(CLONE).as_posix()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield file, alias.name, node in inside
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield file, whole if source(whole) else node.module, node in inside


def source(name: str) -> Path | None:
    """File of a module of the harness."""
    base = CLONE / name.replace(".", "/")
    return next((p for p in (base.with_suffix(".py"), base / "__init__.py") if p.is_file()), None)


def lint(root: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from importlinter.cli import lint_imports_command as lint; lint()"]
    environment = {"PATH": "/usr/bin:/bin", "PYTHONPATH": f"{root}:{root / 'target'}", "COLUMNS": "200"}
    return subprocess.run(
        [*command, "--no-cache"], cwd=root, env=environment, capture_output=True, text=True, check=False
    )


def test_contracts_hold() -> None:
    """Packages import in one direction, without cycles, and harness and target do not know each other."""
    done = lint(CLONE)
    assert done.returncode == 0, done.stdout + done.stderr


def test_shape_of_the_house() -> None:
    """Few modules lie at the top, no modules import in a circle, and no import hides in a function."""
    top = sorted(path.name for path in MUTATOR.glob("*.py"))
    edges = {str(path.relative_to(CLONE)): set[str]() for path in modules()}
    for path in modules():
        for file, name, _ in imports(path):
            if name.startswith("mutator.") and (found := source(name)):
                edges[file].add(str(found.relative_to(CLONE)))
    hidden = [
        f"{file}: {name}"
        for path in modules()
        for file, name, inside in imports(path)
        if inside and name.partition(".")[0] == "mutator" and not file.startswith(LAZY)
    ]
    print(f"modules at the top: {len(top)}, imports inside functions: {len(hidden)}", end=", ")
    TopologicalSorter(edges).prepare()  # CycleError names the modules of a circle
    print("cycles: 0")
    assert len(top) <= TOP_MODULES, top
    assert not hidden


def test_what_runs_inside_a_target_needs_little() -> None:
    """Modules that run in a target's process import the standard library and numpy only."""
    allowed = {*sys.stdlib_module_names, "numpy"}
    for path in (MUTATOR / "engines" / "in_target").glob("*.py"):
        for file, name, _ in imports(path):
            assert name.partition(".")[0] in allowed, f"{file} imports {name}"


def test_no_function_bears_its_modules_name() -> None:
    """`package.name` is either a module or a function, so nobody imports one for the other."""
    for path in modules():
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                assert node.name != path.stem, path


def test_every_package_says_what_it_is_for() -> None:
    """The docstring of a package says what lives there, and what never does."""
    for path in MUTATOR.rglob("__init__.py"):
        text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
        assert text and len(text) > 60, path


VIOLATIONS = {
    "direction": ("mutator/faults/specs.py", "from mutator.campaigns import plans"),
    "direction, in a function": (
        "mutator/faults/specs.py",
        "def f():\n    from mutator.campaigns import plans",
    ),
    "cycle": ("mutator/mutants/patches.py", "from mutator.mutants import building"),
    "cycle of types": (
        "mutator/mutants/patches.py",
        "import typing\nif typing.TYPE_CHECKING:\n    from mutator.mutants import building",
    ),
    "target": ("mutator/engines/reference.py", "import selfdrive.sim.run"),
    "harness": ("target/selfdrive/sim/run.py", "import mutator.errors"),
    "study": ("mutator/report/building.py", "from mutator import paper"),
    "new package": ("mutator/novel.py", "X = 1"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", VIOLATIONS)
def test_a_violation_fails_the_lint(name: str, tmp_path: Path) -> None:
    """Each contract notices an import that it forbids."""
    ignored = shutil.ignore_patterns("__pycache__", "*.npz")
    for folder in ("mutator", "target"):
        shutil.copytree(CLONE / folder, tmp_path / folder, ignore=ignored)
    shutil.copy(CLONE / "pyproject.toml", tmp_path)
    file, line = VIOLATIONS[name]
    with (tmp_path / file).open("a", encoding="utf-8") as module:
        module.write(f"\n{line}\n")
    assert lint(tmp_path).returncode == 1


# vocabulary of options and help texts, and how data are shown: no verb does its work by them
SHOWN_BY_THE_COMMAND_LINE = {
    "mutator.config.yaml_files",
    "mutator.engines.kinds",
    "mutator.exports",
    "mutator.mutants.readable_diffs",
    "mutator.review.columns",
    "mutator.review.readable_groups",
}


def test_the_command_line_calls_the_api() -> None:
    """What a verb does is a call of the public API: the command line imports no package behind it."""
    own = ("mutator.api.", "mutator.cli", "mutator._common.", "mutator.errors")
    for path in (MUTATOR / "cli").glob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        types = {
            node
            for block in ast.walk(tree)
            if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
            for node in ast.walk(block)
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module and node not in types:
                inside = node.module.startswith("mutator.") and not node.module.startswith(own)
                assert not inside or node.module in SHOWN_BY_THE_COMMAND_LINE, f"{path}: {node.module}"
